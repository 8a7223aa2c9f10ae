# arm64 `virt`, UART clock 48 MHz, with the PL011 (0x9000000) left alone by the kernel: MmioUart has it.
# shellcheck shell=sh
mmio="mmio:pl011@0x9000000,clock=48MHz"

# Debian's driver for it is built in and cannot be unbound: the device tree says that it is not to be used.
alone() { [ ! -e /dev/ttyAMA0 ] && [ ! -e /sys/bus/amba/devices/9000000.pl011/driver ]; }
check "the kernel leaves the PL011 alone" alone

mmio_port() {
  tm485 info "$mmio" "$late" && return
  tm485 info "$mmio" "$late" 2>&1 | grep -q "none of the three kinds" && skip "tm485 knows no port mmio:"
  return 1
}
check "MmioUart: 2.5 Mbit/s, the encoder answers" mmio_port
mmio_samples() { mmio_port && samples 10000 "$mmio"; }
check "MmioUart: 10000 samples without an error" mmio_samples
mmio_eeprom() { mmio_port && eeprom_round "$mmio"; }
check "MmioUart: EEPROM dumped, changed and restored" mmio_eeprom
