# arm64 `virt`, UART clock 48 MHz: PL011 (ttyAMA0, 0x9000000) with a simulated encoder on its line, PL061 (gpiochip0).
# shellcheck shell=sh
uart=/dev/ttyAMA0

check "PL011 at 48 MHz: 2.5 Mbit/s accepted, the encoder answers" tm485 info $uart "$late"
check "SerialPort: 10000 samples without an error" samples 10000 $uart
check "SerialPort: EEPROM dumped, changed and restored" eeprom_round $uart

kernel_direction() {
  tm485 info $uart "$late" --direction kernel --json | tee /tmp/info
  grep -q '"control":"kernel' /tmp/info
  samples 500 $uart --direction kernel
}
check "TIOCSRS485: direction by the kernel, 500 samples" kernel_direction

# The data register of the PL061: bits 9:2 of the address choose the lines, so this is the one of line 5 alone.
register=0x9030080
gpio_direction() {
  samples 500 $uart --direction gpio:gpiochip0:5
  equal "line afterwards" 0x00 "$(devmem $register 8)"
}
check "PL061: direction by a GPIO line, 500 samples" gpio_direction
check "PL061: 1000 levels of the DE line are those in its register" tm485_vm_gpio_line gpio:gpiochip0:5 $register 1000
