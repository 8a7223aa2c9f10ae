# arm64 `virt`, UART clock 48 MHz, with the PL011 (0x9000000) left alone by the kernel: MmioUart has it.
# shellcheck shell=sh
mmio="mmio:pl011@0x9000000,clock=48MHz"

# Debian's driver for it is built in and cannot be unbound: the device tree says that it is not to be used.
alone() { [ ! -e /dev/ttyAMA0 ] && [ ! -e /sys/bus/amba/devices/9000000.pl011/driver ]; }
check "the kernel leaves the PL011 alone" alone

check "MmioUart: 2.5 Mbit/s, the encoder answers" tm485 info "$mmio" "$late"
check "MmioUart: 10000 samples without an error" samples 10000 "$mmio"
check "MmioUart: EEPROM dumped, changed and restored" eeprom_round "$mmio"
