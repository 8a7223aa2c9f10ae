#!/usr/bin/env bash
# Fuzzes the parsers, the exchange, the bus, the C interface and what the tools read (tests/fuzz), bounded: libFuzzer,
# Clang 19, address and undefined-behaviour sanitizers.
#
#   tools/fuzz.sh [--seconds N | --runs N] [TARGET...]   N seconds of fuzzing in all, shared evenly, 60 by default (on two
#                                                        processors half as long by the clock); or N executions of each
#                                                        target; all targets by default
#   tools/fuzz.sh --seed S ...                           from the corpora of the tree only, and as little by chance as
#                                                        libFuzzer can: some targets go the same way every time
#   tools/fuzz.sh --plain ...                            without sanitizers, and comparisons not looked at: many more executions
#   tools/fuzz.sh --longest N ...                        inputs of at most N bytes: 1024 by default, files 8192
#   tools/fuzz.sh --list                                 the targets
#   tools/fuzz.sh --replay TARGET FILE...                runs files, for example one that a fuzzer has kept
#
# Starts from tests/fuzz/corpus/TARGET; what is found on the way goes to build/fuzz/corpus/TARGET and is used again. An
# input that ends a process is kept in build/fuzz/crashes, named with the command that replays it, and makes the exit
# code 1. The last line is "N targets, N executions, N failed".
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
cd "$root"

all=(frame reply request exchange bus c sim_options plan image journal profile quantities arguments)
seconds=60 runs=0 seed=0 preset=asan profile=1 most=0 targets=()
number() { [[ ${1:-} =~ ^[1-9][0-9]*$ ]] || { printf 'fuzz: expected a number, got "%s"\n' "${1:-}" >&2 && exit 2; }; }
known() { [[ " ${all[*]} " == *" ${1:-} "* ]] || { printf 'fuzz: no target "%s"; there are: %s\n' "${1:-}" "${all[*]}" >&2 && exit 2; }; }
replay=""
while (($#)); do
  case $1 in
    -h | --help) sed -n '2,/^set /{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}" && exit 0 ;;
    --list) printf '%s\n' "${all[@]}" && exit 0 ;;
    --seconds) number "${2:-}" && seconds=$2 && shift 2 ;;
    --runs) number "${2:-}" && runs=$2 && shift 2 ;;
    --seed) number "${2:-}" && seed=$2 profile=0 && shift 2 ;;
    --longest) number "${2:-}" && most=$2 && shift 2 ;;
    --plain) preset=fuzz profile=0 && shift ;;
    --replay) known "${2:-}" && replay=$2 && shift 2 && break ;;
    *) known "$1" && targets+=("$1") && shift ;;
  esac
done
((${#targets[@]})) || targets=("${all[@]}")
[[ -z $replay ]] || targets=("$replay")

tools/setup.sh run check
build "$preset" "${targets[@]/#/tm485_fuzz_}"

export ASAN_OPTIONS=allocator_may_return_null=0:detect_stack_use_after_return=0
export UBSAN_OPTIONS=print_stacktrace=1
export LSAN_OPTIONS="suppressions=$root/tests/lsan.supp:print_suppressions=0"
programs=build/$preset/tests/fuzz crashes=build/fuzz/crashes logs=build/fuzz/logs
mkdir -p "$crashes" "$logs"

if [[ -n $replay ]]; then
  exec "$programs/tm485_fuzz_$replay" "$@"
fi

# one TARGET LIMIT...: a fuzzer of one target.
one() {
  local target=$1 status=0
  shift
  local log=$logs/$target.log found=build/fuzz/corpus/$target longest=1024
  [[ $target != image && $target != journal && $target != profile && $target != plan ]] || longest=8192
  ((most == 0)) || longest=$most
  if ((seed != 0)); then
    found=build/fuzz/seed-$seed/$target && rm -rf "$found"
    set -- "$@" -entropic=0 -reload=0 # these go by the clock
  fi
  mkdir -p "$found"
  # -timeout: one input for longer than 10 s counts as a failure too. -malloc_limit_mb: so does a single huge request.
  "$programs/tm485_fuzz_$target" "$@" -seed="$seed" -max_len="$longest" -timeout=10 -rss_limit_mb=2048 -malloc_limit_mb=256 \
    -print_final_stats=1 -artifact_prefix="$crashes/$target-" -use_value_profile="$profile" -close_fd_mask=1 \
    "$found" "tests/fuzz/corpus/$target" >"$log" 2>&1 || status=$?
  local executions rate
  executions=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
  rate=$(sed -n 's/^stat::average_exec_per_sec: *//p' "$log")
  printf '%-12s %10s executions, %7s a second, exit %d\n' "$target" "${executions:-?}" "${rate:-?}" "$status" |
    tee "$logs/$target.result"
  ((status == 0)) || {
    grep -E 'does not hold|ERROR: |runtime error|SUMMARY' "$log" | sed "s/^/  $target: /" >&2 || true
    sed -n 's|.*Test unit written to \(.*\)|  replay: tools/fuzz.sh --replay '"$target"' \1|p' "$log" >&2
  }
}
export -f one
export programs crashes logs seed profile most
if ((runs)); then
  limit=(-runs="$runs")
else
  each=$((seconds / ${#targets[@]}))
  limit=(-max_total_time=$((each > 0 ? each : 1)))
fi
rm -f "$logs"/*.result
printf '%s\n' "${targets[@]}" | xargs -P "$jobs" -I '{}' bash -c 'one "$@"' one '{}' "${limit[@]}"

failed=$(grep -L 'exit 0$' "$logs"/*.result | wc -l || true)
awk -v failed="$failed" '{ n += $2 } END { printf "%d targets, %d executions, %d failed\n", NR, n, failed }' "$logs"/*.result
((failed == 0))
