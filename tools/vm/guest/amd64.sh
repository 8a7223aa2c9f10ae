# amd64: 16550s on PCI, ttyS1 and ttyS2 crossed, ttyS3 with a simulated encoder on its line; gpio-sim for a GPIO chip.
# shellcheck shell=sh

# QEMU's 16550 has a clock of 1.8432 MHz: nothing above 115200 bit/s.
refused() { says "asked for 2500000 bit/s, the driver has set" tm485 info /dev/ttyS1; }
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
  has --direction
  says "TIOCSRS485" tm485 info /dev/ttyS1 --direction kernel
  grep -q "errno 25" /tmp/says.log
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
