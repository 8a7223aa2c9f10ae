// tm485 doctor: what is wrong with a port, in plain words. It only reads.

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>

#include "commands.hpp"
#include "doctor/checks.hpp"
#include "output.hpp"
#include "profile_file.hpp"
#include "stop_signal.hpp"

namespace tm485::cli {
namespace {

/// One line on standard error that is drawn again in its place; nothing if that is no terminal.
class ProgressLine {
 public:
  ProgressLine() : terminal_(::isatty(STDERR_FILENO) == 1) {}
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;
  ~ProgressLine() { clear(); }

  void show(std::string_view text) {
    if (!terminal_) return;
    fmt::print(stderr, "\r\x1b[2K{} ...", text);
    std::fflush(stderr);
    drawn_ = true;
  }
  void clear() {
    if (drawn_) fmt::print(stderr, "\r\x1b[2K");
    std::fflush(stderr);
    drawn_ = false;
  }

 private:
  bool terminal_;
  bool drawn_ = false;
};

/// Problem: it cannot begin, because the command means no port.
std::expected<void, Problem> examine(doctor::Patient& patient) {
  const auto opened = check_port(patient);
  if (!opened) return std::unexpected(opened.error());
  if (!*opened) return {};
  check_host(patient);
  for (const auto& check : {doctor::check_answer, doctor::check_line, doctor::check_encoder}) {
    check(patient);
    if (!patient.answers || stop_requested() || patient.line.gone()) break;
  }
  if (patient.line.gone()) patient.report.add(doctor::FindingId::port_gone, patient.options.port);
  return {};
}

}  // namespace

int run_doctor(const DoctorOptions& options) {
  const std::string& text = options.port.port;
  const auto loaded =
      load_profile(options.port.profile.empty() ? AnyPort::default_profile(text) : options.port.profile);
  if (!loaded) return report(loaded.error());
  Profile profile = loaded->profile();
  profile.echo = profile.echo || options.port.echo;
  const auto compiled = CompiledProfile::compile(profile);
  if (!compiled) return report(problem_of(compiled.error().code, profile.name));

  ProgressLine progress;
  doctor::Patient patient(options.port, *compiled,
                          [&progress](std::string_view what) { progress.show(what); });
  if (const auto begun = examine(patient); !begun) {
    progress.clear();
    return report(begun.error());
  }
  patient.report.stopped = stop_requested();
  progress.clear();
  Output output;
  output.write(options.port.json ? report_json(patient.report, text, profile.name)
                                 : report_text(patient.report, text, profile.name));
  return finish(output, patient.report.healthy() && !patient.report.stopped ? kExitGood : kExitFailure);
}

}  // namespace tm485::cli
