#!/usr/bin/env bash
# Fetches libgpiod 2.x for Debian 12, whose own is 1.6, and unpacks it beside the system: nothing is installed.
#
#   tools/libgpiod2.sh [FOLDER]     FOLDER: where to, build/libgpiod2 by default
#
# Then: cmake --preset gpiod2 (or -DTM485_LIBGPIOD_ROOT=FOLDER). The packages are libgpiod-dev and libgpiod3 of the
# backports suite; libgpiod2 is the name of the package with version 1. Mirror and architecture are those of the
# machine's own apt; its lists, its cache and its settings stay as they are. TM485_DEB_ARCH=arm64 fetches for
# another architecture.
#
# Exit codes: 0 it is there, 1 it should have worked, 77 SKIPPED: it cannot be had here.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

folder=$(realpath -m "${1:-$root/build/libgpiod2}")
packages=(libgpiod-dev libgpiod3)

skip() {
  printf 'libgpiod2: SKIPPED: %s\n' "$1" >&2
  exit 77
}

# version_in FOLDER: that of the unpacked library, or nothing.
version_in() { sed -n 's/^Version: //p' "$1"/usr/lib/*/pkgconfig/libgpiod.pc 2>/dev/null || true; }

have=$(version_in "$folder")
if [[ $have == 2.* && $(cat "$folder/architecture" 2>/dev/null) == "${TM485_DEB_ARCH:-}" ]]; then
  printf 'libgpiod2: %s is in %s\n' "$have" "$folder"
  exit 0
fi

command -v apt-get >/dev/null && command -v dpkg-deb >/dev/null || skip "this is not a Debian system"
codename=$(sed -n 's/^VERSION_CODENAME=//p' /etc/os-release)
[[ -n $codename ]] || skip "/etc/os-release names no release of Debian"

# The first source of the release itself: where it comes from.
mirror=""
while IFS='|' read -r uri suite; do
  if [[ $suite == "$codename" ]]; then
    mirror=$uri
    break
  fi
done < <(apt-get indextargets --format '$(REPO_URI)|$(RELEASE)' 'Created-By: Packages' 2>/dev/null || true)
[[ -n $mirror ]] || skip "apt has no source for $codename"
keyring=/usr/share/keyrings/debian-archive-keyring.gpg
signed_by=""
[[ ! -r $keyring ]] || signed_by="[signed-by=$keyring] "

state=$(mktemp -d)
trap 'rm -rf "$state"' EXIT
mkdir -p "$state"/{etc,lists/partial,cache/archives/partial,packages}
: >"$state/status"
printf 'deb %s%s %s-backports main\n' "$signed_by" "$mirror" "$codename" >"$state/etc/sources.list"
options=(-q -o "Dir::Etc::SourceList=$state/etc/sources.list" -o "Dir::Etc::SourceParts=/dev/null"
  -o "Dir::State=$state" -o "Dir::State::Lists=$state/lists" -o "Dir::State::Status=$state/status"
  -o "Dir::Cache=$state/cache" -o "APT::Sandbox::User=" -o "Acquire::Retries=3" -o "Acquire::Languages=none")
if [[ -n ${TM485_DEB_ARCH:-} ]]; then
  options+=(-o "APT::Architecture=$TM485_DEB_ARCH" -o "APT::Architectures::=$TM485_DEB_ARCH")
fi

if ! apt-get "${options[@]}" update >"$state/log" 2>&1 || grep -qE '^(E|Err)' "$state/log"; then
  tail -n 5 "$state/log" >&2
  skip "$codename-backports cannot be read from the mirror of this machine"
fi
if ! (cd "$state/packages" && apt-get "${options[@]}" download "${packages[@]}") >"$state/log" 2>&1; then
  tail -n 5 "$state/log" >&2
  skip "$codename-backports has no ${packages[*]}"
fi

rm -rf "$folder"
mkdir -p "$folder"
for package in "$state"/packages/*.deb; do
  dpkg-deb --extract "$package" "$folder"
done
printf '%s' "${TM485_DEB_ARCH:-}" >"$folder/architecture"
have=$(version_in "$folder")
if [[ $have != 2.* ]]; then
  printf 'libgpiod2: the backports suite has version %s, and not 2\n' "${have:-none}" >&2
  exit 1
fi
printf 'libgpiod2: unpacked %s into %s\n' "$have" "$folder"
