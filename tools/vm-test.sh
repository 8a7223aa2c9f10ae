#!/usr/bin/env bash
# Boots Debian's own kernels in QEMU and runs our programs in them: docs/vm-tests.md.
#
#   tools/vm-test.sh               all machines
#   tools/vm-test.sh MACHINE...    these only: amd64, arm64-24mhz, arm64, arm64-mmio
#   tools/vm-test.sh --cached ...  without the network: what is not in build/vm is skipped
#
# Needs the packages of group vm (tools/setup.sh vm). The kernels and arm64's libraries are unpacked into build/vm and
# stay there. Each check is a line: PASS, FAIL or SKIP. The last line is "N passed, N failed".
# Exit codes: 0 good, 1 a check failed, 2 usage, 77 nothing could be run.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
cd "$root"
vm=$root/build/vm
sockets=build/vm # a socket's path has 107 bytes at most
source tools/vm/packages.sh
source tools/vm/programs.sh
source tools/vm/machine.sh

online=1 encoder="" reason="" machines=()
all=(amd64 arm64-24mhz arm64 arm64-mmio)
for argument in "$@"; do
  case "$argument" in
    -h | --help)
      sed -n '2,/^set /{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}"
      exit 0
      ;;
    --cached) online=0 ;;
    *)
      if [[ " ${all[*]} " != *" $argument "* ]]; then
        printf 'vm-test: no machine %s; there are: %s\n' "$argument" "${all[*]}" >&2
        exit 2
      fi
      machines+=("$argument")
      ;;
  esac
done
((${#machines[@]})) || machines=("${all[@]}")

mkdir -p "$vm"
exec 9>"$vm/lock"
flock -n 9 || { printf 'vm-test: another run uses build/vm\n' >&2 && exit 1; }
cleanup() { [[ -z $encoder ]] || stop_encoder; }
trap cleanup EXIT

# has_tools PROGRAM...: sets `reason` if one is missing.
has_tools() {
  local program
  for program in "$@"; do
    command -v "$program" >/dev/null || { reason="no $program: tools/setup.sh vm" && return 1; }
  done
}

# start_tree NAME BUSYBOX FOLDERS PROGRAM...: a file system with programs, their libraries from FOLDERS (words).
start_tree() {
  local name=$1 busybox=$2 folders=$3 program
  shift 3
  new_tree "$name" "$busybox" || return
  for program in "$@"; do
    # shellcheck disable=SC2086  # words
    add_program "$tree" "$program" $folders || return
  done
}

# The encoder's own account, when the machine is off: REPLIES at least, and its EEPROM as it was.
judge_encoder() {
  local name=$1 wanted=$2 about
  stop_encoder
  about="$name: the encoder counted ${replies:-no} replies, at least $wanted wanted"
  if [[ ${replies:-0} -ge $wanted ]]; then pass "$about"; else fail "$about"; fi
  about="$name: the encoder's EEPROM is as it was at first"
  if cmp -s "$vm/eeprom.bin" "$vm/encoder.eeprom"; then pass "$about"; else fail "$about"; fi
}

prepare_amd64() {
  [[ $(uname -m) == x86_64 ]] || { reason="its programs are those of an amd64 host" && return 1; }
  has_tools qemu-system-x86_64 cpio make gcc && fetch amd64 || return
  reason=""
  amd64_programs=(build/dev/tools/tm485 build/dev/tests/vm/tm485_vm_{serial_pair,claim_clock,gpio_line})
  build_gpio_sim && build dev tm485_vm_{serial_pair,claim_clock,gpio_line} || return
  [[ $online == 1 || -d build/libgpiod2 ]] || return 0
  # The same program with libgpiod 2.x, where that can be had; otherwise its check is skipped.
  local status=0
  tools/libgpiod2.sh build/libgpiod2 || status=$?
  ((status != 77)) || return 0
  ((status == 0)) && build gpiod2 tm485_vm_gpio_line &&
    cp build/gpiod2/tests/vm/tm485_vm_gpio_line{,2} &&
    amd64_programs+=(build/gpiod2/tests/vm/tm485_vm_gpio_line2)
}

# ttyS0 is the console. The two ends of one socket cross the lines of ttyS1 and ttyS2.
run_amd64() {
  local libraries=/usr/lib/x86_64-linux-gnu crossed=$sockets/crossed
  start_tree amd64 /bin/busybox "$libraries /lib/x86_64-linux-gnu /lib64 build/libgpiod2$libraries" "${amd64_programs[@]}" &&
    cp "$vm/gpio-sim/gpio-sim.ko" "$vm/root-amd64/lib/modules/$kernel/kernel/fs/configfs/configfs.ko" "$tree" &&
    rm -f "$crossed" && start_encoder || return
  boot amd64 qemu-system-x86_64 -M pc -cpu max -accel tcg,thread=multi -chardev stdio,id=console,signal=off \
    -serial chardev:console \
    -chardev "socket,id=one,path=$crossed,server=on,wait=off" -chardev "socket,id=other,path=$crossed" \
    -chardev "socket,id=encoder,path=$sockets/encoder" \
    -device pci-serial,chardev=one -device pci-serial,chardev=other -device pci-serial,chardev=encoder \
    -kernel "$vm/root-amd64/boot/vmlinuz-$kernel" \
    -append "tm485.console=/dev/ttyS0 quiet panic=-1 mitigations=off"
  judge_encoder amd64 1000
}

prepare_arm64() {
  has_tools qemu-system-aarch64 fdtput cpio aarch64-linux-gnu-g++ && fetch arm64 || return
  reason=""
  [[ -z ${arm64_built:-} ]] || return 0
  build_into build/vm-arm64 "tm485 tm485_vm_gpio_line" -DTM485_ARM64_ROOT="$vm/root-arm64" \
    -DCMAKE_TOOLCHAIN_FILE="$root/cmake/toolchains/aarch64-linux-gnu.cmake" && arm64_built=1
}

# boot_virt NAME CLOCK [PL011'S STATUS]: both are properties in the device tree, which QEMU writes with 24 MHz.
boot_virt() {
  local name=$1 clock=$2 status=${3:-okay} from=$vm/root-arm64 dtb=$vm/virt.dtb
  local machine=(qemu-system-aarch64 -M virt -cpu cortex-a53)
  "${machine[@]}" -machine "dumpdtb=$dtb" -m 256 -smp 2 -nodefaults -display none 2>/dev/null
  fdtput -t i "$dtb" /apb-pclk clock-frequency "$clock" &&
    fdtput -t s "$dtb" /pl011@9000000 status "$status" || return
  start_tree "$name" "$from/bin/busybox" \
    "$from/usr/lib/aarch64-linux-gnu $from/lib/aarch64-linux-gnu /usr/aarch64-linux-gnu/lib" \
    build/vm-arm64/{tools/tm485,tests/vm/tm485_vm_gpio_line} &&
    start_encoder || return
  boot "$name" "${machine[@]}" -accel tcg,thread=multi -dtb "$dtb" \
    -chardev "socket,id=encoder,path=$sockets/encoder" -serial chardev:encoder \
    -chardev stdio,id=console,signal=off -device pci-serial,chardev=console \
    -kernel "$from/boot/vmlinuz-$kernel" \
    -append "tm485.console=/dev/ttyS0 quiet panic=-1 iomem=relaxed mitigations=off"
}
run_arm64-24mhz() {
  boot_virt arm64-24mhz 24000000 && stop_encoder
}
run_arm64() {
  boot_virt arm64 48000000 || return
  judge_encoder arm64 10000
}
run_arm64-mmio() {
  boot_virt arm64-mmio 48000000 disabled || return
  judge_encoder arm64-mmio 10000
}

say "Building"
build dev tm485
simulator=build/dev/tools/tm485
make_eeprom
for machine in "${machines[@]}"; do
  say "$machine"
  reason=""
  if "prepare_${machine%%-*}"; then
    "run_$machine" || fail "$machine: could not be started"
  elif [[ -n $reason ]]; then
    skip "$machine: $reason"
  else
    fail "$machine: its programs were not built"
  fi
done

((skipped == 0)) || printf '\nSKIPPED: %d, see above\n' "$skipped"
printf '%d passed, %d failed\n' "$good" "$bad"
((bad == 0)) || exit 1
((good > 0)) || exit 77
