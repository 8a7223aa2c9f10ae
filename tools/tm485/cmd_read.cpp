// tm485 read: every cycle of a run, one line each.

#include <fmt/format.h>

#include "commands.hpp"
#include "direction_view.hpp"
#include "json_output.hpp"
#include "output.hpp"
#include "quantity.hpp"
#include "sample_text.hpp"
#include "session.hpp"
#include "statistics_text.hpp"
#include "stop_signal.hpp"

namespace tm485::cli {
namespace {

constexpr Time kDefaultPeriod = std::chrono::milliseconds(1);
/// Lines wait no longer than this for company on their way out.
constexpr Time kFlushEvery = std::chrono::milliseconds(20);

std::expected<SessionOptions, Problem> session_options(const ReadOptions& options) {
  SessionOptions session;
  session.port = options.port;
  session.cycle.id = static_cast<DataId>(options.id);
  session.units = units_of(options.units);
  if (options.period.empty()) {
    session.wished_period = kDefaultPeriod;
  } else if (const auto period = parse_period_option(options.period)) {
    session.cycle.period = *period;
  } else {
    return std::unexpected(period.error());
  }
  return session;
}

/// What happened besides the lines; nothing if all went well.
void report_summary(const Session& session, const Statistics& statistics) {
  if (statistics.failed != 0) {
    fmt::print(stderr, "tm485: {} of {} cycles failed: {}\n", statistics.failed, statistics.cycles,
               error_counts(statistics));
  }
  if (statistics.skipped != 0 || statistics.lost != 0) {
    fmt::print(stderr, "tm485: {} slots skipped because they were missed; encoder lost {} times\n",
               statistics.skipped, statistics.lost);
  }
  if (session.unseen_records() != 0) {
    fmt::print(stderr, "tm485: {} cycles without a line: the next request failed in the same instant\n",
               session.unseen_records());
  }
}

int read_cycles(Session& session, const ReadOptions& options, Output& output) {
  if (const auto started = session.wait_for_startup(); !started)
    return started.error().exit_code == kExitGood ? kExitGood : report(started.error());
  if (!options.port.json) output.write(sample_header(session));
  Time flushed{0};
  std::uint64_t lines = 0;
  while (!stop_requested() && (options.count == 0 || lines < options.count)) {
    const bool recorded = session.step();
    if (recorded && session.bus().last_record().kind == CycleRecord::Kind::cyclic) {
      const Sample& sample = session.bus().latest();
      const Errc result = session.bus().last_record().result;
      if (!output.write(options.port.json ? sample_json(session, sample, result)
                                          : sample_row(session, sample, result)))
        break;
      ++lines;
    }
    if (const Time now = session.now(); now - flushed >= kFlushEvery) {
      flushed = now;
      if (!output.flush()) break;
    }
    if (const auto problem = session.failure()) {
      (void)output.flush();
      return report(*problem);
    }
  }
  if (lines == 0 || session.bus().statistics().good != 0) return kExitGood;
  return report({"no_sample", "not one cycle brought a sample", "see the causes: tm485 bench counts them",
                 kExitFailure});
}

}  // namespace

int run_read(const ReadOptions& options) {
  const auto settings = session_options(options);
  if (!settings) return report(settings.error());
  const auto session = Session::open(*settings);
  if (!session) return report(session.error());
  warn_of_direction((*session)->port());
  Output output;
  const int exit_code = read_cycles(**session, options, output);
  const int result = finish(output, exit_code);
  report_summary(**session, (*session)->bus().statistics());
  return result;
}

}  // namespace tm485::cli
