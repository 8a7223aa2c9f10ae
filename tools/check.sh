#!/usr/bin/env bash
# Everything that is checked besides the tests with GCC (those are tools/test.sh).
#
#   tools/check.sh                 all steps
#   tools/check.sh STEP...         these only
#   tools/check.sh --list          their names
#   tools/check.sh --fix           puts the sources into the format that the step `format` asks for
#
# Installs what is missing. The last line is "N passed, N failed", counted in steps.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
cd "$root"

# Cheap steps first: what fails, fails early.
steps=(policy format headers heap model spin campaign arm cost firmware gpiod2 tsan clang asan fuzz mutants tidy vm)
# By name only: coverage.
fuzz_seconds=300  # of the step fuzz, all targets together
mutant_count=10   # of the step mutants
declare -A about
warnings=(-Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Werror)

# sources PATTERN...: the tree's files, with those that are not yet committed. None at all is an error.
sources() { git -c safe.directory="$root" ls-files --cached --others --exclude-standard -- "$@" | sort -u | grep .; }

about[policy]="include layers, headers of the core, words (tools/policy.py, and its self-test), excuses of mutants that are gone"
step_policy() {
  python3 tools/policy.py --self-test && python3 tools/policy.py && tools/mutants.py --check
}

about[format]="clang-format-19"
step_format() {
  sources '*.hpp' '*.h' '*.cpp' '*.c' | xargs -r -P "$jobs" -n 16 clang-format-19 --dry-run -Werror 2>&1 | head -n 60
}

about[headers]="each public header compiles alone, twice included: GCC, those of core and hal/mcu also for Cortex-M, those of C as C99 and with Clang 19 too"
# header_alone HEADER LANGUAGE COMPILER...
header_alone() {
  local header=$1 language=$2
  shift 2
  printf '#include "%s"\n#include "%s"\nextern int alone;\n' "$header" "$header" | "$@" -x "$language" - && return
  printf '%s does not compile alone: %s\n' "$header" "$*" >&2
  return 1
}
step_headers() {
  local part headers header name own compiler flags="-std=c++23 -fsyntax-only ${warnings[*]} -Icore/include"
  local c_flags="-std=c99 -fsyntax-only ${warnings[*]} -Icore/include -Icore/c/include"
  export -f header_alone
  for part in core core/c core/design hal/posix hal/sim hal/mcu hal/linux; do
    # A hal's headers see the core and their own folder, and no other; those of linux see the register drivers and posix too.
    own="-I$part/include"
    [[ $part != hal/linux ]] || own+=" -Ihal/mcu/include -Ihal/posix/include"
    headers=$(sources "$part/include/*.hpp") || [[ $part == core/c ]] || exit
    for header in $headers; do
      name=${header#*/include/}
      printf '%s c++ g++ %s %s\n' "$name" "$flags" "$own" # Clang has the same standard library, and all of them in sources
      if [[ $part == core || $part == hal/mcu ]]; then
        printf '%s c++ arm-none-eabi-g++ -mcpu=cortex-m0plus -mthumb -fno-exceptions -fno-rtti %s %s\n' "$name" "$flags" "$own"
      fi
    done
    [[ $part == core/c ]] || continue
    for name in $(sources 'core/c/include/*.h' 'core/include/*.h'); do
      name=${name#*/include/}
      for compiler in gcc clang-19 "arm-none-eabi-gcc -mcpu=cortex-m0plus -mthumb"; do
        printf '%s c %s %s\n' "$name" "$compiler" "$c_flags"
      done
      for compiler in g++ clang++-19 "arm-none-eabi-g++ -mcpu=cortex-m0plus -mthumb -fno-exceptions -fno-rtti"; do
        printf '%s c++ %s %s %s\n' "$name" "$compiler" "$flags" "$own"
      done
    done
  done | xargs -P "$jobs" -L 1 bash -c 'header_alone "$@"' header_alone
}

# join LD OUT FILE...: whole archives and programs' objects in one, so that what it leaves undefined are the symbols that
# the core takes from others, templates included.
join() { "$1" -r --whole-archive "${@:3}" -o "$2"; }

# undefined_in NM OBJECT
undefined_in() { "$1" --undefined-only --format=posix "$2" | cut -d' ' -f1; }

about[heap]="the core and its C interface use neither heap nor exceptions, on the host (tests/firmware is its user)"
step_heap() {
  build dev tm485_core tm485_c || return
  local folder=build/dev/core found
  g++ -std=c++23 -O2 -fno-exceptions -fno-rtti -Icore/include -c tests/firmware/firmware.cpp -o "$folder/user.o" &&
    join ld "$folder/whole.o" "$folder/libtm485_core.a" "$folder/c/libtm485_c.a" "$folder/user.o" || return
  found=$(undefined_in nm "$folder/whole.o" | grep -E \
    '^(malloc|calloc|realloc|free|aligned_alloc|posix_memalign|_Zn[wa].*|_Zd[la].*|__cxa_.*|_Unwind_.*|_ZSt[0-9]+__throw_.*)$' || true)
  [[ -z $found ]] || { printf 'the core uses:\n%s\n' "$found" >&2 && return 1; }
}

about[arm]="the core and the register drivers for Cortex-M0+, M4F and M7: builds, needs only memory and compiler helpers, keeps no static RAM; its size"
step_arm() {
  local preset folder objects object found bad=0
  for preset in arm-m0plus arm arm-m7; do
    folder=build/$preset
    build "$preset" || { bad=1 && continue; }
    # The bus, then the register drivers, each joined with the core and its C interface.
    objects=$folder/tests/firmware/CMakeFiles
    for object in tm485_firmware.dir/firmware.cpp.obj tm485_firmware_drivers.dir/drivers.cpp.obj; do
      join arm-none-eabi-ld "$folder/whole.o" "$folder/core/libtm485_core.a" "$folder/core/c/libtm485_c.a" "$objects/$object" || { bad=1 && continue; }
      found=$(undefined_in arm-none-eabi-nm "$folder/whole.o" | grep -vE '^(mem(cpy|set|move|cmp)|__aeabi_.*|__gnu_thumb.*)$' || true)
      [[ -z $found ]] || { printf '%s: core or %s needs:\n%s\n' "$preset" "${object##*/}" "$found" >&2 && bad=1; }
    done
  done
  ((bad)) || report_size build/arm || bad=1
  return "$bad"
}
# report_size FOLDER: how big the core is. Static RAM would be state that two buses share, or a table that failed to
# land in flash, so it is refused.
report_size() {
  local status=0
  printf 'Cortex-M4, -Os (goal for the core'"'"'s code: 6144 B):\n'
  arm-none-eabi-size -A "$1/core/libtm485_core.a" | awk '
    $1 ~ /^\.text/ { code += $2 }
    $1 ~ /^\.rodata/ { constants += $2 }
    $1 ~ /^\.(data|bss)/ { ram += $2 }
    END {
      printf "  the library, all of it:            code %5d B, constants %5d B, static RAM %d B\n", code, constants, ram
      exit ram != 0
    }' || status=1
  arm-none-eabi-size -A "$1/core/c/libtm485_c.a" | awk '
    $1 ~ /^\.text/ { code += $2 }
    $1 ~ /^\.rodata/ { constants += $2 }
    $1 ~ /^\.(data|bss)/ { ram += $2 }
    END {
      printf "  the C interface, all of it:        code %5d B, constants %5d B, static RAM %d B\n", code, constants, ram
      exit ram != 0
    }' || status=1
  { arm-none-eabi-size -A "$1/tests/firmware/tm485_firmware"; arm-none-eabi-nm -S --radix=d "$1/tests/firmware/tm485_firmware"; } | awk '
    $1 == ".text" { code = $2 }
    $1 == ".rodata" { constants = $2 }
    NF == 4 && $3 ~ /^[tTwW]$/ && $4 ~ /5tm485|^firmware_entry$/ && !($1 in seen) { seen[$1] = 1; own += $2 }
    END {
      printf "  a firmware with the whole bus:     code %5d B, constants %5d B\n", own, constants
      printf "  compiler and C library in it:      code %5d B\n", code - own
    }'
  arm-none-eabi-size -A "$1/tests/firmware/tm485_firmware_c" | awk '
    $1 == ".text" { code = $2 }
    $1 == ".rodata" { constants = $2 }
    $1 == ".bss" { ram = $2 }
    END { printf "  a firmware in C with a bus:        code %5d B, constants %5d B, bus and profile %d B of RAM\n", code, constants, ram }'
  ((status == 0)) || printf 'the core has static RAM\n' >&2
  return "$status"
}

about[cost]="instructions, flash, RAM and stack of the core on Cortex-M, against bench/firmware/record.json (docs/firmware-cost.md)"
step_cost() { bench/firmware/report.py --self-test && bench/firmware/report.py; }

# What optimisation may change is here; the rest is built by the same compiler, with the same warnings, in asan.
about[clang]="Clang 19, optimised: the benchmarks, and the tests of core, lock-free types and registers"
step_clang() {
  local targets=(tm485_bench) part parts=(core integration mcu sync)
  for part in "${parts[@]}"; do targets+=("tm485_tests_$part"); done
  build clang-dev "${targets[@]}" && tests_of clang-dev --label-regex "^($(IFS='|' && printf %s "${parts[*]}"))\$"
}

about[asan]="Clang 19 with the address and undefined-behaviour sanitizers: all of the build and the tests"
step_asan() {
  build asan && LSAN_OPTIONS="suppressions=$root/tests/lsan.supp:print_suppressions=0" tests_of asan
}

about[gpiod2]="direction control with libgpiod 2.x, unpacked beside the system (the other builds use what is installed)"
step_gpiod2() {
  local status=0
  tools/libgpiod2.sh || status=$?
  if ((status == 77)); then
    printf '\n*** SKIPPED: libgpiod 2.x was neither built against nor tested ***\n\n'
    return 0
  fi
  ((status == 0)) || return "$status"
  build gpiod2 tm485_tests_linux_fake || return
  quiet build/gpiod2/gpiod2.log build/gpiod2/tests/tm485_tests_linux_fake || return
  grep -oE '^\[ +PASSED +\] [0-9]+ tests' build/gpiod2/gpiod2.log | sed 's/.*\] /libgpiod 2.x: passed /'
}

about[fuzz]="libFuzzer on every parser, the bus and the C interface, $fuzz_seconds s in all (tests/fuzz, tools/fuzz.sh)"
# One seed: a run that fails on one machine should fail on every other.
step_fuzz() { tools/fuzz.sh --seconds "$fuzz_seconds" --seed 485; }

about[coverage]="statements and branches of the core that the tests execute, and an excuse for every line that they do not"
step_coverage() { tools/coverage.sh | tail -n 20; }

about[mutants]="$mutant_count mutants of the core, chosen by the commit: tests have to notice most (tools/mutants.py)"
# Ten say little of the share: one that survives is printed for somebody to look at, and several are a failure only if the
# tests have stopped seeing much.
step_mutants() {
  tools/mutants.py --count "$mutant_count" --minutes 6 --least 60 --seed "$(git -c safe.directory="$root" rev-parse HEAD)"
}

about[model]="relacy: the lock-free types under weak memory, and weakened twins that it must find"
step_model() {
  build dev tm485_model && build/dev/tests/model/tm485_model
}

about[spin]="spin: the whole protocol with faults, every way: T1, bounded waits, recovery; and broken twins that it must find"
step_spin() { tools/spin.sh; }

about[campaign]="tm485 campaign: 2 * 10^8 cycles of the whole stack under random fault plans, every one judged (docs/fault-plans.md)"
step_campaign() {
  # With the build that the tests have used: it has assertions, and costs nothing here. One seed: a run that fails on one
  # machine fails on every other.
  build dev tm485 || return
  build/dev/tools/tm485 campaign --cycles 200000000 --seed 485 --jobs "$jobs" </dev/null
}

about[tsan]="thread sanitizer with GCC and Clang 19, no suppressions: stress of the lock-free types, and races that it must find"
step_tsan() {
  local preset
  for preset in tsan gcc-tsan; do
    build "$preset" tm485_tests_sync tm485_sync_canary || return
    # SpscRingWrap moves 2^32 bytes twice: a second in the tests of every other build, minutes in this one.
    quiet "build/$preset/sync.log" "build/$preset/tests/tm485_tests_sync" --gtest_filter='-SpscRingWrap.*' || return
    grep -oE '^\[ +PASSED +\] [0-9]+ tests' "build/$preset/sync.log" | sed "s/.*\] /$preset: no race in /"
    canaries "build/$preset/tests/tm485_sync_canary" || return
  done
}
# canaries PROGRAM: each race of tests/sync_canary must be reported. Otherwise the sanitizer sees nothing.
canaries() {
  local race report
  for race in plain triple_buffer four_slot ring; do
    if report=$("$1" "$race" 2>&1) || ! grep -q 'WARNING: ThreadSanitizer: data race' <<<"$report"; then
      printf 'no race was reported in %s %s:\n%s\n' "$1" "$race" "$report" >&2
      return 1
    fi
  done
  printf '  and 4 of 4 seeded races were reported\n'
}

# tests_of PRESET [ARGUMENT OF CTEST...]
tests_of() {
  local status=0
  run_tests "$@" || status=$?
  printf '%d tests passed, %d failed\n' "$passed" "$failed"
  return "$status"
}

about[tidy]="clang-tidy-19 over core, hal and tools"
step_tidy() {
  quiet build/clang-dev/configure.log cmake --preset clang-dev || return
  # Only what this configuration compiles: of the backends of a GPIO line it is one.
  sources 'core/*.cpp' 'hal/*.cpp' 'tools/*.cpp' |
    grep -Fxf <(python3 -c 'import json, os; [print(os.path.relpath(e["file"])) for e in json.load(open("build/clang-dev/compile_commands.json"))]') |
    xargs -r -P "$jobs" -n 1 clang-tidy-19 -p build/clang-dev --quiet 2>build/clang-dev/tidy.log || {
    grep -vE '^[0-9]+ warnings? (generated|treated)' build/clang-dev/tidy.log >&2
    return 1
  }
}

about[firmware]="the firmware examples in QEMU against the simulated encoder (docs/firmware.md)"
step_firmware() { tools/firmware-test.sh; }

about[vm]="our programs on Debian's own kernels in QEMU: UARTs, GPIO, memory-mapped UART (docs/vm-tests.md)"
step_vm() {
  tools/setup.sh vm || printf 'what is missing is skipped\n' >&2
  tools/vm-test.sh
}

case "${1:-}" in
  -h | --help)
    sed -n '2,/^set /{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}"
    exit 0
    ;;
  --list)
    for step in "${steps[@]}"; do
      printf '%-8s %s\n' "$step" "${about[$step]}"
    done
    exit 0
    ;;
  --fix)
    tools/setup.sh check
    sources '*.hpp' '*.h' '*.cpp' '*.c' | xargs -r clang-format-19 -i
    exit 0
    ;;
esac

for step in "$@"; do
  if ! declare -F "step_$step" >/dev/null; then
    printf 'check: no step %s; there are: %s\n' "$step" "${steps[*]}" >&2
    exit 2
  fi
done
(($# == 0)) || steps=("$@")

say "Setting up: Debian packages that are missing (tools/packages.txt, groups run and check)"
tools/setup.sh run check

good=0 bad_steps=() skipped_steps=()
for step in "${steps[@]}"; do
  say "$step: ${about[$step]}"
  started=$SECONDS status=0
  "step_$step" || status=$?
  case $status in
    0) good=$((good + 1)) outcome=passed ;;
    77) skipped_steps+=("$step") outcome=SKIPPED ;;
    *) bad_steps+=("$step") outcome=FAILED ;;
  esac
  printf '%s %s in %d s\n' "$step" "$outcome" $((SECONDS - started))
done

((${#skipped_steps[@]} == 0)) || printf '\nSKIPPED, could not be run here, or not to the end: %s\n' "${skipped_steps[*]}"
((${#bad_steps[@]} == 0)) || printf '\nFailed: %s\n' "${bad_steps[*]}"
printf '\n%d passed, %d failed\n' "$good" "${#bad_steps[@]}"
((${#bad_steps[@]} == 0))
