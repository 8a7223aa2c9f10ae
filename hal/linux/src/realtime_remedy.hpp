// How to get what an ordinary user is refused; said by the thread that was refused and by the look at the settings.
#pragma once

namespace tm485::linux_hal {

inline constexpr const char* kPriorityRemedy =
    "allow it: a line '@realtime - rtprio 99' in /etc/security/limits.d/realtime.conf, join that group (sudo "
    "groupadd -f "
    "realtime; sudo adduser $USER realtime) and log in again; or give the program the capability: sudo "
    "setcap "
    "cap_sys_nice,cap_ipc_lock+ep PROGRAM; in a service: LimitRTPRIO=99";

inline constexpr const char* kLockRemedy =
    "allow it: a line '@realtime - memlock unlimited' in /etc/security/limits.d/realtime.conf, join that "
    "group and log in "
    "again; or sudo setcap cap_sys_nice,cap_ipc_lock+ep PROGRAM; in a service: LimitMEMLOCK=infinity. A page "
    "that is not "
    "there costs microseconds to milliseconds in the middle of a cycle";

}  // namespace tm485::linux_hal
