# Sourced in the machine, before /checks: one line a check, PASS, FAIL or SKIP.
# shellcheck shell=sh
checks=0

# check NAME COMMAND...: passes if it exits with 0, is skipped if with 77; the last line that it writes is the reason.
# Of a function every command must succeed. What a failed one wrote is shown, indented.
check() {
  name=$1
  shift
  checks=$((checks + 1))
  before=$(uptime_s)
  (set -e; "$@") >/tmp/check.log 2>&1
  case $? in
    0) echo "PASS $name ($(($(uptime_s) - before)) s)" ;;
    77) echo "SKIP $name: $(tail -n 1 /tmp/check.log)" ;;
    *)
      echo "FAIL $name"
      sed 's/^/     /' /tmp/check.log | tail -n 30
      ;;
  esac
}

uptime_s() { cut -d. -f1 /proc/uptime; }

skip() {
  echo "$*"
  exit 77
}

# says TEXT COMMAND...: it fails with exit code 1 and its message contains TEXT.
says() {
  text=$1
  shift
  code=0
  "$@" >/tmp/says.log 2>&1 || code=$?
  cat /tmp/says.log
  [ "$code" = 1 ] || { echo "exit code $code"; return 1; }
  grep -qF -e "$text" /tmp/says.log || { echo "does not say: $text"; return 1; }
}

# equal WHAT WANTED FOUND
equal() {
  [ "$2" = "$3" ] || { echo "$1: wanted '$2', found '$3'"; return 1; }
}

# Emulation stops for as long as the host pleases: replies may be this late.
late=--latency=1s

# samples COUNT PORT [OPTION...]: as many cycles, each with a fresh sample, and no error. If the emulation stops in the middle of
# start-up, the gate does not know the speed well enough, and holds the first two samples back: that is none of the line.
samples() {
  count=$1
  shift
  tm485 read "$@" "$late" -n "$count" --period min --json >/tmp/samples 2>/tmp/errors || { cat /tmp/errors; return 1; }
  cat /tmp/errors
  held=$(head -n 2 /tmp/samples | grep -c '"error":"position_implausible"' || :)  # 0: grep fails
  equal "lines" "$count" "$(wc -l </tmp/samples)"
  equal "fresh samples" "$((count - held))" "$(grep -c '"quality":"fresh"' /tmp/samples)"
  equal "errors" "$held" "$(grep -c '"error"' /tmp/samples)"
  rm /tmp/samples
}

# eeprom_round PORT [OPTION...]: dumps, and it is what the host has put there; changes bytes of the last page;
# restores the dump. The host compares at the end.
eeprom_round() {
  tm485 eeprom dump "$@" "$late" -o /tmp/dump.bin
  cmp /tmp/dump.bin /eeprom.bin
  tm485 eeprom write "$@" "$late" --page 6 --addr 63 --hex "$other" --yes
  code=0
  tm485 eeprom diff "$@" "$late" /tmp/dump.bin >/tmp/differences || code=$?
  equal "exit code of diff" 1 "$code"
  tm485 eeprom restore "$@" "$late" /tmp/dump.bin --yes
  rm -f /tmp/dump.bin*
}
# 64 bytes, none of which is in /eeprom.bin.
other=$(printf 'FF%.0s' $(seq 64))
