// What the help of several sub-commands says of ports.
#pragma once

namespace tm485::cli {

inline constexpr const char* kSimKeys =
    "Keys of sim: profile, rpm, accel, cruise, motion, start, turn, seed, enid, sf, almc, t2, latch_offset, "
    "boot, echo,\n"
    "jitter, margin, release, baud, ber, lost, plan, glitch, swap, power, eeprom_busy; for example "
    "sim:rpm=3000,ber=1e-6,almc=40";

}  // namespace tm485::cli
