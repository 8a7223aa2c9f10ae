# Sourced by tools/vm-test.sh: a simulated encoder on the host, a machine in QEMU, and the account of its checks.
# shellcheck shell=bash disable=SC2034,SC2154  # vm, sockets, tree, simulator, replies: tools/vm-test.sh and programs.sh
good=0 bad=0 skipped=0

pass() { printf 'PASS %s\n' "$1" && good=$((good + 1)); }
fail() { printf 'FAIL %s\n' "$1" && bad=$((bad + 1)); }
skip() { printf 'SKIP %s\n' "$1" && skipped=$((skipped + 1)); }

# make_eeprom: the bytes of an EEPROM, build/vm/eeprom.bin. None of them is FF.
make_eeprom() {
  local i
  for ((i = 0; i < 7 * 127; i++)); do
    printf '%b' "\\x$(printf %02x $((i * 7 % 255)))"
  done >"$vm/eeprom.bin"
}

# start_encoder: a simulated encoder behind the socket build/vm/encoder. Its process id in `encoder`.
start_encoder() {
  rm -f "$sockets/encoder"
  cp "$vm/eeprom.bin" "$vm/encoder.eeprom"
  "$simulator" sim --unix "$sockets/encoder" --rpm 3000 --eeprom "$vm/encoder.eeprom" --eeprom-write 1ms \
    --eeprom-page 1ms >"$vm/encoder.log" 2>&1 9>&- &
  encoder=$!
  local tries
  for ((tries = 0; tries < 100; tries++)); do
    [[ ! -S $sockets/encoder ]] || return 0
    sleep 0.05
  done
  cat "$vm/encoder.log" >&2
  return 1
}

# stop_encoder: sets `replies` to the number that it sent.
stop_encoder() {
  kill -INT "$encoder" 2>/dev/null || true
  wait "$encoder" 2>/dev/null || true
  encoder=""
  replies=$(sed -n 's/.* \([0-9]*\) replies$/\1/p' "$vm/encoder.log")
}

# boot NAME QEMU ARGUMENT...: runs the machine with `tree` until it powers off, at most 300 s, and counts its checks.
# Its console is the standard output of QEMU.
boot() {
  local name=$1 log=$vm/$1.log started=$SECONDS status=0
  shift
  pack_tree || return
  timeout --foreground -k 5 300 "$@" -m 256 -smp 2 -nodefaults -display none -no-reboot -initrd "$tree.gz" 2>&1 </dev/null 9>&- |
    sed -u 's|\r||g' | tee "$log" | sed -u "s/^\(PASS\|FAIL\|SKIP\) /\1 $name: /" || status=$?
  count_checks "$name" "$log" "$status"
  printf '%s: %d s\n' "$name" $((SECONDS - started))
}

# count_checks NAME LOG STATUS: a machine that did not come to its end has failed, whatever it said before.
count_checks() {
  local name=$1 log=$2 status=$3 passed failed left_out
  passed=$(grep -c '^PASS ' "$log" || true)
  failed=$(grep -c '^FAIL ' "$log" || true)
  left_out=$(grep -c '^SKIP ' "$log" || true)
  good=$((good + passed)) bad=$((bad + failed)) skipped=$((skipped + left_out))
  if ! grep -q "^DONE $((passed + failed + left_out)) checks" "$log" || ((passed + failed + left_out == 0)); then
    fail "$name: the machine did not come to its end (status $status); all that it said: $log"
  fi
}
