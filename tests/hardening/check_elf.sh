#!/usr/bin/env bash
# Is a program hardened? Reads what the linker has written, so that a flag that was lost is found.
#
#   tests/hardening/check_elf.sh PROGRAM                   one line for each property that is missing; 1 if there is one
#   tests/hardening/check_elf.sh --self-test COMPILER DIR  programs that lack one of them each: every lack must be found
set -euo pipefail

# check PROGRAM
check() {
  local header segments dynamic symbols bad=0
  header=$(readelf -hW "$1") segments=$(readelf -lW "$1") dynamic=$(readelf -dW "$1") symbols=$(readelf --dyn-syms -W "$1")
  lacks() { printf '%s: %s\n' "$1" "$2" && bad=1; }
  grep -qE 'Type: +DYN' <<<"$header" || lacks pie "$1 is not position independent"
  grep -q GNU_RELRO <<<"$segments" || lacks relro "$1 has no read-only relocations"
  grep -qE 'BIND_NOW|FLAGS_1.*NOW' <<<"$dynamic" || lacks now "$1 binds its calls late"
  grep -qE 'GNU_STACK.* RW +0x' <<<"$segments" || lacks stack "$1 has a stack that can be executed"
  ! grep -qE ' RWE +0x' <<<"$segments" || lacks rwe "$1 has memory that can be written and executed"
  ! grep -qE 'RPATH|RUNPATH' <<<"$dynamic" || lacks rpath "$1 looks for libraries in a folder of its own"
  grep -q __stack_chk_fail <<<"$symbols" || lacks guard "$1 has no stack guards"
  grep -qE '__[a-z]+_chk(@| |$)' <<<"$symbols" || lacks fortify "$1 has no checked string functions"
  return "$bad"
}

if [[ ${1:-} != --self-test ]]; then
  check "$1"
  exit
fi

compiler=$2 folder=$3
mkdir -p "$folder"
cat >"$folder/victim.cpp" <<'SOURCE'
#include <cstdio>
#include <cstring>
int main(int count, char** words) {
  char text[16];
  std::strncpy(text, words[0], static_cast<unsigned>(count) * 8);
  std::puts(text);
}
SOURCE
good=(-O2 -w -fPIE -pie -fstack-protector-strong -U_FORTIFY_SOURCE -D_FORTIFY_SOURCE=3 -Wl,-z,relro,-z,now,-z,noexecstack)
failures=0
# expect LACK FLAG...: LACK is what must be found, or nothing.
expect() {
  local lack=$1 found
  shift
  "$compiler" "${good[@]}" "$@" "$folder/victim.cpp" -o "$folder/victim"
  found=$(check "$folder/victim" | cut -d: -f1 | tr '\n' ' ' || true)
  [[ (-z $lack && -z $found) || (-n $lack && " $found" == *" $lack "*) ]] || {
    printf 'self-test: with %s expected "%s", found "%s"\n' "$*" "$lack" "$found"
    failures=$((failures + 1))
  }
}
expect ""
expect pie -fno-pie -no-pie
expect relro -Wl,-z,norelro
expect now -Wl,-z,lazy
expect stack -Wl,-z,execstack
expect rpath -Wl,-rpath,/nowhere
expect guard -fno-stack-protector
expect fortify -U_FORTIFY_SOURCE
printf 'self-test: 8 programs, %d problems\n' "$failures"
((failures == 0))
