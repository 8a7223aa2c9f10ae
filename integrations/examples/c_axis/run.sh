#!/bin/sh
# c_axis on a simulated encoder: run.sh [C_AXIS [TM485]]
set -eu
c_axis=${1:-build/c_axis}
tm485=${2:-tm485}
folder=$(mktemp -d)
"$tm485" sim --rpm 60 --link "$folder/encoder" >"$folder/log" &
simulator=$!
trap 'kill "$simulator" 2>/dev/null || true; wait "$simulator" 2>/dev/null || true; rm -r "$folder"' EXIT
tries=0
while [ ! -e "$folder/encoder" ]; do
  tries=$((tries + 1))
  [ "$tries" -lt 200 ] || { echo "run.sh: the simulator did not start" >&2; exit 1; }
  sleep 0.1
done
"$c_axis" "$folder/encoder"
