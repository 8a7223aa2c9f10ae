# amd64: 16550s on PCI, ttyS1 and ttyS2 crossed, ttyS3 with a simulated encoder on its line; gpio-sim for a GPIO chip.
# shellcheck shell=sh

# QEMU's 16550 has a clock of 1.8432 MHz: nothing above 115200 bit/s.
refused() { says "use a UART or adapter that can make this rate" tm485 info /dev/ttyS1; }
check "16550 with its own clock: 2.5 Mbit/s refused with our error" refused

crossed() {
  tm485_vm_claim_clock /dev/ttyS1 2500000
  tm485_vm_claim_clock /dev/ttyS2 2500000
  tm485_vm_serial_pair /dev/ttyS1 /dev/ttyS2 300
}
check "16550 with a claimed clock: 2.5 Mbit/s accepted, 300 exchanges over crossed lines" crossed

encoder() {
  tm485_vm_claim_clock /dev/ttyS3 2500000
  samples 1000 /dev/ttyS3
}
check "SerialPort on a 16550: 1000 samples without an error" encoder

no_rs485() {
  says "RS485: Inappropriate ioctl for device (errno 25)" tm485 info /dev/ttyS1 --direction kernel
}
check "16550: TIOCSRS485 is refused with our error (ENOTTY)" no_rs485

gpio=/sys/kernel/config/gpio-sim/tm485
load_gpio_sim() {
  insmod /configfs.ko
  mount -t configfs configfs /sys/kernel/config
  insmod /gpio-sim.ko
  mkdir -p $gpio/bank0/line3
  echo 8 >$gpio/bank0/num_lines
  echo tm485-sim >$gpio/bank0/label
  echo DE >$gpio/bank0/line3/name
  echo 1 >$gpio/live
  [ -c "/dev/$(cat $gpio/bank0/chip_name)" ]
}
check "gpio-sim: a chip of 8 lines" load_gpio_sim

# Where gpio-sim shows the level of line 3, which has the name DE.
seen() { echo "/sys/devices/platform/$(cat $gpio/dev_name)/$(cat $gpio/bank0/chip_name)/sim_gpio3/value"; }

# line PROGRAM LIBRARY: by offset, active low, and by name; our code is linked with the library that it is said to be.
line() {
  chip=/dev/$(cat $gpio/bank0/chip_name)
  "$1" "gpio:$chip:3" "$(seen)" 1000
  "$1" "gpio:$chip:3:low" "$(seen)" 10
  "$1" gpio:DE "$(seen)" 10 | tee /tmp/line
  grep -q "^libgpiod $2" /tmp/line
}
check "libgpiod 1.6: 1000 levels of the DE line are those in sysfs" line tm485_vm_gpio_line 1.6
libgpiod2() {
  [ -e /bin/tm485_vm_gpio_line2 ] || skip "libgpiod 2.x is not on the host (tools/libgpiod2.sh)"
  line tm485_vm_gpio_line2 2.
}
check "libgpiod 2.x: 1000 levels of the DE line are those in sysfs" libgpiod2

directed() { tm485_vm_serial_pair /dev/ttyS1 /dev/ttyS2 100 gpio:DE "$(seen)"; }
check "16550: the DE line is on during 100 requests, and off after each" directed

directed_encoder() { samples 200 /dev/ttyS3 --direction gpio:tm485-sim:DE; }
check "16550: direction by the DE line, 200 samples" directed_encoder

no_such_line() {
  says "gpiodetect" tm485 info /dev/ttyS3 --direction gpio:tm485-nobody:3
  says "cannot open" tm485 info /dev/ttyS3 --direction gpio:tm485-sim:8
}
check "gpio-sim: a chip or line that is not there is refused with our error" no_such_line
