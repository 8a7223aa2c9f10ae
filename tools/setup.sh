#!/usr/bin/env bash
# Installs what is missing of the Debian packages that a purpose needs; does nothing where nothing is missing.
#
#   tools/setup.sh [GROUP...]     groups of tools/packages.txt: run (the default), check, bench, firmware, vm
#
# Needs bash and apt only. Installs as root or through sudo where that asks for no password; otherwise prints the
# line to run and exits with 1.
set -euo pipefail

list="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)/packages.txt"
groups=("${@:-run}")

fail() {
  printf 'setup: %s\n' "$1" >&2
  exit 1
}

# The packages of the groups, in the order of the list.
wanted=()
for group in "${groups[@]}"; do
  found=0
  while read -r of package _; do
    if [[ $of == "$group" ]]; then
      wanted+=("$package")
      found=1
    fi
  done <"$list"
  ((found)) || fail "no group '$group' in packages.txt"
done

if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then
  fail "this is not a Debian system; what it needs, by Debian's names: ${wanted[*]}"
fi

# missing_packages: sets `missing` to those of `wanted` that are not installed.
missing_packages() {
  local installed package
  installed=$(dpkg-query -W -f='${db:Status-Status} ${Package}\n' "${wanted[@]}" 2>/dev/null || true)
  missing=()
  for package in "${wanted[@]}"; do
    grep -qxF "installed $package" <<<"$installed" || missing+=("$package")
  done
}

missing_packages
((${#missing[@]})) || exit 0

as_root=()
if ((EUID != 0)); then
  if command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
    as_root=(sudo -n)
  else
    fail "these packages are missing; install them and start again:
  sudo apt-get update && sudo apt-get install -y --no-install-recommends ${missing[*]}"
  fi
fi

printf 'setup: installing %s\n' "${missing[*]}"
apt() { "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q -o Acquire::Retries=3 "$@"; }
log=$(mktemp)
trap 'rm -f "$log"' EXIT
for step in "update" "install -y --no-install-recommends ${missing[*]}"; do
  # shellcheck disable=SC2086  # the step is a list of words
  if ! apt $step >"$log" 2>&1; then
    tail -n 30 "$log" >&2
    fail "'apt-get ${step%% *}' failed: see above. Is the machine online, and its Debian 12 (bookworm)?"
  fi
done

missing_packages
((${#missing[@]} == 0)) || fail "still missing after the installation: ${missing[*]}"
