#!/usr/bin/env bash
# Installs what is missing, builds with GCC, runs the tests. The last line is "N passed, N failed".
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
cd "$root"

say "Setting up: Debian packages that are missing (tools/packages.txt, group run)"
tools/setup.sh run

passed=0 failed=1
finish() { printf '%d passed, %d failed\n' "$passed" "$failed"; }
trap finish EXIT

say "Building with GCC (preset dev: optimised, with assertions)"
build dev

say "Running the tests"
failed=0
run_tests dev
