#!/usr/bin/env bash
# The model of the protocol (tests/spin/bus.pml) in spin: no way breaks an assertion, and each broken twin does on some way.
#
#   tools/spin.sh [--faults N]      N faults on each way (3)
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

faults=3
case "${1:-}" in
  "") ;;
  --faults) faults=${2:?"--faults wants a number"} ;;
  -h | --help)
    sed -n '2,/^set /{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}"
    exit 0
    ;;
  *)
    printf 'spin: %s is no option\n' "$1" >&2
    exit 2
    ;;
esac
[[ $faults =~ ^[1-9]$ ]] || { printf 'spin: --faults %s: 1 to 9\n' "$faults" >&2 && exit 2; }

folder=$root/build/spin
mkdir -p "$folder"

# check NAME [DEFINE]: the account of an exhaustive search.
check() {
  local place=$folder/$1
  mkdir -p "$place"
  (cd "$place" && spin -a -DFAULTS="$faults" ${2:+"-D$2"} "$root/tests/spin/bus.pml" >spin.log &&
    gcc -O2 -DSAFETY -DMEMLIM=4096 -DCOLLAPSE -w -o pan pan.c && timeout 600 ./pan -m1000000 >pan.log 2>&1) || true
  [[ -s $place/pan.log ]] || { printf 'spin: %s was not searched:\n%s\n' "$1" "$(cat "$place"/*.log)" >&2 && return 1; }
  grep -q 'error: max search depth too small\|out of memory' "$place/pan.log" && {
    printf 'spin: %s was not searched to its end\n' "$1" >&2
    return 1
  }
  sed -n 's/.*errors: \([0-9]*\).*/\1/p' "$place/pan.log"
}

errors=$(check bus)
[[ $errors == 0 ]] || { printf 'spin: the model breaks an assertion:\n%s\n' "$(head -n 20 "$folder/bus/pan.log")" >&2 && exit 1; }
grep -q '^.*(0 of [0-9]* states)' "$folder/bus/pan.log" || {
  printf 'spin: part of the model is never reached:\n%s\n' "$(sed -n '/unreached/,$p' "$folder/bus/pan.log")" >&2
  exit 1
}
printf 'the model: no error on any way; %s states\n' "$(sed -n 's/ *\([0-9.e+]*\) states, stored.*/\1/p' "$folder/bus/pan.log")"

for twin in T1 TIMEOUT SETTLE HOLD STARVES; do
  errors=$(check "twin-$twin" "TWIN_$twin")
  [[ $errors =~ ^[1-9] ]] || { printf 'spin: the twin without %s was not found\n' "$twin" >&2 && exit 1; }
  printf 'the twin %s: %s\n' "$twin" "$(sed -n 's/^pan:[0-9]*: //p' "$folder/twin-$twin/pan.log" | head -n 1)"
done
