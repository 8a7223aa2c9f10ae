# arm64 `virt` with its UART clock as it is, 24 MHz: 16 clocks a bit are not there for 2.5 Mbit/s.
# shellcheck shell=sh
refused() { says "use a UART or adapter that can make this rate" tm485 info /dev/ttyAMA0 --latency 100ms; }
check "PL011 at 24 MHz: 2.5 Mbit/s refused with our error" refused
