#!/usr/bin/env bash
# Builds the firmware examples and runs them in QEMU against `tm485 sim`: docs/firmware.md.
#
#   tools/firmware-test.sh            everything, and a table at the end
#   tools/firmware-test.sh WORD...    only the runs that have all these words in their names: servo_node, netduinoplus2, faults
#
# Installs what is missing. Each run is a line, PASS or FAIL. The last line is "N passed, N failed".
# Exit codes: 0 good, 1 a run failed or nothing could be built, 2 usage.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
cd "$root"

words=()
for word in "$@"; do
  case "$word" in
    -h | --help)
      sed -n '2,/^set /{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}"
      exit 0
      ;;
    -*)
      printf 'firmware-test: no option %s\n' "$word" >&2
      exit 2
      ;;
    *) words+=(--only "$word") ;;
  esac
done

say "Setting up: Debian packages that are missing (tools/packages.txt, groups run and firmware)"
tools/setup.sh run firmware

say "Building"
build arm
build arm-m0plus
build dev tm485

say "Running"
exec python3 tools/firmware/run.py "${words[@]}"
