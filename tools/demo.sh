#!/usr/bin/env bash
# From nothing to an encoder read at its full rate: installs what is missing, builds, shows the simulated encoder.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
cd "$root"

say "Setting up: Debian packages that are missing (tools/packages.txt, group run)"
tools/setup.sh run

say "Building the tm485 command (release; the first time takes a minute or two)"
build release tm485

show() {
  say "$*"
  PATH="$root/build/release/tools:$PATH" "$@"
}
show tm485 monitor sim: --seconds 4
show tm485 bench sim: --id 3 --period 62.5us --seconds 3
show tm485 bench sim: --id 0 --period 40us --seconds 3
