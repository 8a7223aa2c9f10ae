// tm485 monitor: the live view of one encoder. Survives an encoder that is lost and a device that is unplugged.

#include <fmt/format.h>

#include "commands.hpp"
#include "direction_view.hpp"
#include "monitor_view.hpp"
#include "output.hpp"
#include "quantity.hpp"
#include "sample_text.hpp"
#include "screen.hpp"
#include "stop_signal.hpp"

namespace tm485::cli {
namespace {

constexpr Time kDrawEvery = std::chrono::milliseconds(100);
constexpr Time kLineEvery = std::chrono::seconds(1);

class Monitor {
 public:
  Monitor(Session& session, bool json)
      : session_(&session), screen_(output_), json_(json), drawn_(!json && Output::is_terminal()) {}

  /// Runs until `end` or Ctrl-C.
  int run(Time end) {
    const Time every = drawn_ && !session_->virtual_time() ? kDrawEvery : kLineEvery;
    Time next = session_->now() + every;
    while (!stop_requested() && session_->now() < end) {
      (void)session_->step(std::min(next, end));
      (void)session_->tend_port(drawn_);
      if (session_->now() < next) continue;
      if (!show()) break;
      next += every;
      if (next < session_->now()) next = session_->now() + every;
    }
    if (shown_at_ + every / 2 < session_->now()) (void)show();
    const bool any = session_->bus().statistics().good != 0;
    const int result = finish(output_, kExitGood);
    if (any || result != kExitGood || stop_requested()) return result;
    return report(session_->failure().value_or(
        Problem{"no_sample", "not one cycle brought a sample", "see the errors by cause", kExitFailure}));
  }

 private:
  bool show() {
    const Moment moment = moments_.make(*session_);
    shown_at_ = moment.now;
    if (drawn_) return screen_.show(monitor_block(*session_, moment));
    return output_.write((json_ ? monitor_json(*session_, moment) : monitor_line(*session_, moment)) +
                         '\n') &&
           output_.flush();
  }

  Session* session_;
  Output output_;
  Screen screen_;
  MomentMaker moments_;
  bool json_;
  bool drawn_;
  Time shown_at_{0};
};

}  // namespace

int run_monitor(const MonitorOptions& options) {
  SessionOptions settings;
  settings.port = options.port;
  settings.cycle.id = static_cast<DataId>(options.id);
  settings.virtual_time = options.virtual_time;
  const auto period = parse_period_option(options.period.empty() ? "min" : options.period);
  if (!period) return report(period.error());
  settings.cycle.period = *period;
  Time duration = kNever;
  if (!options.seconds.empty()) {
    const auto seconds = parse_time(options.seconds, PlainNumber::seconds);
    if (!seconds)
      return report(usage_problem("bad_duration",
                                  fmt::format("--seconds {}: {}", options.seconds, seconds.error()),
                                  "write seconds (2.5) or a time (500ms)"));
    if (*seconds > Time{0}) duration = *seconds;
  }
  const auto session = Session::open(settings);
  if (!session) return report(session.error());
  warn_of_direction((*session)->port());
  return Monitor(**session, options.port.json).run((*session)->now() + duration);
}

}  // namespace tm485::cli
