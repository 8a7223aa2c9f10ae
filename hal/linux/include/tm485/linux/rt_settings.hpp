// RtSettings: what the settings of a machine allow a real-time thread, each with a verdict and what to change.
//
// Everything is read from files of /proc and /sys, so that it can be read from a copy of another machine's.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace tm485::linux_hal {

enum class Verdict : std::uint8_t {
  good,
  improvable,  ///< works, with worse lateness than the machine could have
  bad,         ///< a real-time thread will not run as it should
  unknown,     ///< the system does not say
};

/// "good", "improvable", "bad", "unknown".
[[nodiscard]] std::string_view verdict_name(Verdict verdict) noexcept;

struct RtSetting {
  std::string name;   ///< stable identifier, for example "rtprio"
  std::string value;  ///< as the system has it, for people
  Verdict verdict = Verdict::unknown;
  std::string remedy;  ///< what to change, in plain words; empty if there is nothing to do
};

/// Reads all of them, of the calling process where they belong to one; always the same names in the same order:
/// kernel, cpus, isolated, nohz_full, governor, clocksource, rtprio, memlock, rt_throttling, fair_server. `root` is put
/// before every path. Errors are settings of verdict unknown. Set-up only: reads files, allocates.
[[nodiscard]] std::vector<RtSetting> read_rt_settings(const std::filesystem::path& root = "/");

}  // namespace tm485::linux_hal
