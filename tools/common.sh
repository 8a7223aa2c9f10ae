# Sourced by demo.sh, test.sh and check.sh: messages, quiet builds, test counts. Not a program of its own.
# shellcheck shell=bash disable=SC2034

root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
jobs="$(nproc 2>/dev/null || echo 2)"

say() { printf '\n== %s\n' "$*"; }

# quiet LOG COMMAND...: the output goes to LOG; its end is shown if the command fails.
quiet() {
  local log=$1 status=0
  shift
  mkdir -p "$(dirname "$log")"
  "$@" >"$log" 2>&1 || status=$?
  ((status != 0)) || return 0
  tail -n 60 "$log" >&2
  printf 'failed (%d): %s\nwhole output: %s\n' "$status" "$*" "$log" >&2
  return "$status"
}

# build PRESET [TARGET...]: configures and builds; both logs are in the build folder.
build() {
  local preset=$1
  shift
  local folder="$root/build/$preset" started=$SECONDS
  quiet "$folder/configure.log" cmake -S "$root" --preset "$preset" || return
  quiet "$folder/build.log" cmake --build "$folder" --parallel "$jobs" ${1:+--target "$@"} || return
  printf 'built %s in %d s\n' "$preset" $((SECONDS - started))
}

# run_tests PRESET [ARGUMENT OF CTEST...]: runs every test of a build, but those in an emulator (tools/vm-test.sh,
# tools/firmware-test.sh); sets `passed` and `failed`. No test at all is a failure.
run_tests() {
  local folder="$root/build/$1" status=0
  shift
  local report="$folder/tests.xml"
  rm -f "$report"
  quiet "$folder/tests.log" ctest --test-dir "$folder" --label-exclude '^(vm|firmware)$' --parallel "$jobs" --no-tests=error --output-on-failure \
    --output-junit "$report" "$@" || status=$?
  passed=0 failed=0
  if [[ -f $report ]]; then
    passed=$(grep -c '<testcase .*status="run"' "$report" || true)
    failed=$(grep -c '<testcase .*status="fail"' "$report" || true)
    local skipped
    skipped=$(grep -c '<testcase .*status="\(notrun\|disabled\)"' "$report" || true)
    ((skipped == 0)) || printf '%d not run:\n%s\n' "$skipped" \
      "$(sed -n 's/.*<testcase name="\([^"]*\)".*status="\(notrun\|disabled\)".*/  \1/p' "$report")"
  fi
  # What ctest holds for a failure and does not list as a test: no report, no tests.
  if ((status != 0 && failed == 0)); then failed=1; fi
  return "$status"
}
