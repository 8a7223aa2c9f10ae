// The steps of the examination, in their order, and what they know of the port so far. Each step ends one or more
// checks of the report; none of them writes to the encoder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "doctor/raw_line.hpp"
#include "doctor/reading.hpp"
#include "doctor/report.hpp"
#include "tm485/linux/rt_settings.hpp"
#include "tm485/linux/time_histogram.hpp"
#include "tm485/protocol/profile.hpp"

namespace tm485::cli::doctor {

/// Counts over the many exchanges of the line check, and what their good replies said.
struct LineRecord {
  std::uint32_t exchanges = 0;
  std::uint32_t failed = 0;
  std::uint32_t spoilt_starts = 0;
  std::uint32_t handed_over_late = 0;  ///< good replies, after the port's latency allowance
  std::uint32_t stray = 0;
  std::array<std::uint32_t, kErrcCount> errors{};  ///< by cause
  std::uint32_t judged_t2 = 0;
  std::uint32_t early = 0;  ///< T2 below the window
  std::uint32_t late = 0;   ///< T2 above it
  Time shortest = kNever;   ///< T2, or without wire timestamps the reply delay that the host sees
  Time longest = -kNever;

  std::uint32_t positions = 0;  ///< good replies to ID3
  std::uint32_t wide = 0;       ///< of them, ABS beyond the profile's single-turn bits
  std::uint32_t largest_abs = 0;
  std::uint32_t first_abm = 0, last_abm = 0;
  std::array<std::uint32_t, kStatusBitCount> status{};  ///< how often each bit was set
};

struct Patient {
  Patient(PortOptions the_options, const CompiledProfile& the_profile,
          std::function<void(std::string_view)> show)
      : options(std::move(the_options)), profile(the_profile), progress(std::move(show)) {}

  PortOptions options;
  CompiledProfile profile;
  RawLine line;
  Report report;
  std::function<void(std::string_view)> progress;  ///< called with what is going on
  bool answers = false;                            ///< replies come, at the profile's rate
  bool echo = false;                               ///< and each request before them
  std::optional<std::uint8_t> enid;
  LineRecord record;
};

/// Opens the port. False: it does not open; the report says why. Problem: the text means no port (exit code 2). Bound:
/// about 1 s.
[[nodiscard]] std::expected<bool, Problem> check_port(Patient& patient);
/// Latency timer of a USB adapter, the kernel's settings, the port's release bound. Reads files only.
void check_host(Patient& patient);
/// Whether anything answers ID2, ID3 and ID0, at which rate, inverted or not, with or without echo. Bound: the profile's
/// power-up time and 20 listening times, and without a reply 3 more at each of the usual rates.
void check_answer(Patient& patient);
/// Some thousand exchanges, at most 4 s: errors by cause, T2, the beginnings of the replies.
void check_line(Patient& patient);
/// ENID, resolution, alarms, battery, EEPROM. Bound: 0.1 s and a few exchanges.
void check_encoder(Patient& patient);

/// One exchange of the later checks: enough bytes for the reply, behind the echo if there is one.
[[nodiscard]] Reading exchange(Patient& patient, const Request& request);

/// The beginnings of most replies are spoilt: late_release, unless the port states that its driver is off by then.
void judge_spoilt_starts(Patient& patient, std::string seen);
/// The port itself states that every reply begins before its driver has left the line.
[[nodiscard]] bool releases_too_late(const Patient& patient);

// The parts of check_host, with the machine's files under another root.
void judge_latency_timer(Report& report, const std::string& port, const std::filesystem::path& root = "/");
/// How late the driver was released after each request so far; `late`: in how many cases too late.
void judge_release_times(Report& report, const linux_hal::TimeHistogram& times, std::uint32_t late);
void judge_kernel(Report& report, const std::vector<linux_hal::RtSetting>& settings);

}  // namespace tm485::cli::doctor
