// The doctor's first steps: the port, the adapter, the machine. Nothing is sent yet.

#include <fmt/format.h>

#include <fstream>

#include "doctor/checks.hpp"
#include "quantity.hpp"
#include "statistics_text.hpp"

namespace tm485::cli::doctor {
namespace {

constexpr int kShortestTimerMs = 1;

/// The names of the settings with that verdict: "rtprio, memlock".
std::string names_of(const std::vector<linux_hal::RtSetting>& settings, linux_hal::Verdict verdict) {
  std::string names;
  for (const linux_hal::RtSetting& setting : settings)
    if (setting.verdict == verdict) names += (names.empty() ? "" : ", ") + setting.name;
  return names;
}

void judge_release(Patient& patient) {
  const Time bound = patient.line.capability().release_bound;
  if (bound <= Time{0}) {
    patient.report.not_judged("direction", "this port does not state when its driver leaves the line");
    return;
  }
  const Time t2_min = patient.profile.profile().t2_min;
  if (bound > t2_min)
    patient.report.add(
        FindingId::release_bound,
        fmt::format("the driver leaves the line up to {} after a request; replies may begin after {}",
                    format_time(bound), format_time(t2_min)));
  patient.report.end_check("direction", fmt::format("driver off the line within {}", format_time(bound)));
}

}  // namespace

std::expected<bool, Problem> check_port(Patient& patient) {
  const std::uint32_t rate = patient.profile.profile().bit_rate;
  patient.progress(fmt::format("opening {}", patient.options.port));
  if (const auto opened = patient.line.open(patient.options, rate); !opened) {
    if (opened.error().exit_code == kExitUsage) return std::unexpected(opened.error());
    Finding& finding = patient.report.add(FindingId::cannot_open, opened.error().cause);
    finding.remedy = opened.error().remedy;
    patient.report.end_check("port", opened.error().name);
    return false;
  }
  patient.report.end_check(
      "port", fmt::format("open at {} bit/s; {}", rate, capability_text(patient.line.capability())));
  return true;
}

void judge_latency_timer(Report& report, const std::string& port, const std::filesystem::path& root) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::path device = fs::canonical(port, error);  // a link of /dev/serial/by-id
  const std::string name = (error ? fs::path(port) : device).filename().string();
  const fs::path file = root / "sys/bus/usb-serial/devices" / name / "latency_timer";
  std::ifstream input(file);
  int milliseconds = 0;
  if (!(input >> milliseconds)) {
    report.skipped("latency timer", "this port has none");
    return;
  }
  if (milliseconds > kShortestTimerMs) {
    Finding& finding = report.add(
        FindingId::latency_timer,
        fmt::format("{} ms: a reply shorter than the adapter's buffer waits that long", milliseconds));
    finding.remedy = fmt::format(
        "set it to 1 ms: echo 1 | sudo tee /sys/bus/usb-serial/devices/{}/latency_timer; "
        "to keep it so, by a udev rule",
        name);
  }
  report.end_check("latency timer", fmt::format("{} ms", milliseconds));
}

void judge_kernel(Report& report, const std::vector<linux_hal::RtSetting>& settings) {
  const std::string bad = names_of(settings, linux_hal::Verdict::bad);
  const std::string improvable = names_of(settings, linux_hal::Verdict::improvable);
  if (!bad.empty()) report.add(FindingId::kernel_not_realtime, bad);
  if (!improvable.empty()) report.add(FindingId::kernel_improvable, improvable);
  report.end_check("kernel",
                   bad.empty() && improvable.empty() ? "as a real-time thread wants it" : "see findings");
}

void check_host(Patient& patient) {
  if (patient.line.simulated()) {
    patient.report.skipped("latency timer", "a simulated encoder has none");
    patient.report.skipped("kernel", "a simulated encoder runs in virtual time here");
  } else {
    judge_latency_timer(patient.report, patient.options.port);
    judge_kernel(patient.report, linux_hal::read_rt_settings());
  }
  judge_release(patient);
}

}  // namespace tm485::cli::doctor
