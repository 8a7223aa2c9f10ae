# arm64 `virt` with its UART clock as it is, 24 MHz: 16 clocks a bit are not there for 2.5 Mbit/s.
# shellcheck shell=sh
refused() { says "asked for 2500000 bit/s, the driver has set" tm485 info /dev/ttyAMA0 --latency 100ms; }
check "PL011 at 24 MHz: 2.5 Mbit/s refused with our error" refused
