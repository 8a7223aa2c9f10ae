#!/usr/bin/env bash
# Which lines and branches of the core the tests execute: GCC's gcov over the tests that build without the command.
#
#   tools/coverage.sh [--lines]   statement and branch coverage of core/, a line a file; --lines: also each line that
#                                 was not executed and is excused
#
# Every line that is not executed must be excused in tests/coverage_exceptions.txt, with the reason; an excuse that fits
# no line any more is an error too. Goals: 98 % of the lines, 90 % of the branches. Exit code 1 if one is missed.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
cd "$root"
[[ ${1:-} != -h && ${1:-} != --help ]] || { sed -n '2,/^set /{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}" && exit 0; }

tools/setup.sh run
programs=(core sync integration c design conformance fuzz)
build coverage "${programs[@]/#/tm485_tests_}" tm485_loop_campaign
# The counts of earlier runs are of other sources.
find build/coverage -name '*.gcda' -delete
for program in "${programs[@]}"; do
  # Minutes without optimisation: 2^32 bytes twice, millions of frames, millions of samples; and threads that wait for each other.
  filter='-SpscRingWrap.*:FrameDifferential.*:EstimatorAccuracy.*:*Stress*'
  if [[ $program == fuzz ]]; then folder=fuzz/; else folder=""; fi
  quiet "build/coverage/$program.log" "build/coverage/tests/${folder}tm485_tests_$program" --gtest_brief=1 --gtest_filter="$filter"
done
quiet build/coverage/campaign.log build/coverage/tests/tm485_loop_campaign 50000 1
python3 tools/coverage.py build/coverage tests/coverage_exceptions.txt "$@"
