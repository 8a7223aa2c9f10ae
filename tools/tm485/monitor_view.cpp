#include "monitor_view.hpp"

#include <fmt/format.h>

#include <array>

#include "frame_view.hpp"
#include "json_output.hpp"
#include "quantity.hpp"
#include "sample_text.hpp"
#include "screen.hpp"
#include "statistics_text.hpp"

namespace tm485::cli {
namespace {

constexpr std::size_t kMostAlarms = 4;
constexpr std::array kCauses{LinkCause::silence, LinkCause::damage, LinkCause::implausible, LinkCause::host};

double seconds(Time time) { return static_cast<double>(time.count()) / 1e9; }

double limit_hz(Session& session) { return 1.0 / seconds(session.profile().t1(session.scheduler().id())); }

std::string alarm_names(StatusSet status, const AlarmPolicy& policy) {
  std::string text;
  for (const StatusInfo& info : status_table()) {
    if (!status.has(info.bit)) continue;
    const AlarmLevel level = policy.level(info.bit);
    text += fmt::format("{}{}{}", text.empty() ? "" : ", ", info.name,
                        level == AlarmLevel::fault     ? " (FAULT)"
                        : level == AlarmLevel::warning ? " (warning)"
                                                       : "");
  }
  return text.empty() ? "none" : text;
}

/// "good", or "degraded, 12000 ppm of the cycles fail (silence 1000, damage 11000)".
std::string link_text(const LinkHealth& link) {
  std::string text(name(link.state()));
  if (!link.measured() || link.rate_ppm() == 0) return text;
  text += fmt::format(", {} ppm of the cycles fail (", link.rate_ppm());
  bool first = true;
  for (const LinkCause cause : kCauses) {
    if (link.failures(cause) == 0) continue;
    text += fmt::format("{}{} {}", first ? "" : ", ", name(cause), link.rate_ppm(cause));
    first = false;
  }
  return text + ')';
}

JsonObject to_json(const LinkHealth& link) {
  JsonObject json;
  json.set("state", name(link.state()));
  if (!link.measured()) return json;
  for (const LinkCause cause : kCauses) json.set(fmt::format("{}_ppm", name(cause)), link.rate_ppm(cause));
  return json;
}

std::string state_text(const Moment& moment, Session& session) {
  if (moment.failure) return fmt::format("NO ENCODER: {}: {}", moment.failure->name, moment.failure->cause);
  if (moment.state != BusState::running)
    return fmt::format("start-up, stage '{}'", name(session.bus().startup_stage()));
  return moment.sample ? std::string(name(moment.sample->quality())) : "no sample yet";
}

void add_position(std::vector<std::string>& lines, Session& session, const Moment& moment) {
  if (!moment.sample) return;
  const Sample& sample = *moment.sample;
  const Profile& profile = session.profile().profile();
  const auto counts = static_cast<double>(std::uint32_t{1} << profile.single_turn_bits);
  const double turn = static_cast<double>(sample.single_turn()) / counts;
  if (sample.has_position()) {
    lines.push_back(fmt::format("position   {:>16} counts   {:>14.4f} rev", sample.position(),
                                static_cast<double>(sample.position()) / counts));
    lines.push_back(fmt::format("angle      {:>16.4f} deg      [{}]", turn * 360.0, gauge(turn, 36)));
  }
  if (profile.multi_turn_bits != 0)
    lines.push_back(fmt::format("turns      {:>16}          ENID {:02X}", sample.turns(), sample.enid()));
  if (moment.speed_rpm) lines.push_back(fmt::format("speed      {:>16.2f} rpm", *moment.speed_rpm));
  lines.push_back(fmt::format("SF, ALMC   {:02X}, {:02X}   alarms: {}", sample.status().sf(),
                              sample.status().almc(), alarm_names(sample.status(), profile.alarms)));
  std::size_t shown = 0;
  for (const StatusInfo& info : status_table()) {
    if (!sample.status().has(info.bit) || profile.alarms.level(info.bit) == AlarmLevel::none ||
        shown++ == kMostAlarms)
      continue;
    lines.push_back(fmt::format("  {} {}: {}; {}", info.field, info.name, info.cause, info.remedy));
  }
}

}  // namespace

Moment MomentMaker::make(Session& session) {
  Moment moment;
  moment.now = session.now();
  moment.state = session.bus().state();
  moment.failure = session.failure();
  moment.statistics = session.bus().statistics();
  const Time elapsed = moment.now - last_time_;
  if (elapsed > Time{0})
    moment.rate_hz = static_cast<double>(moment.statistics.good - last_good_) / seconds(elapsed);
  last_time_ = moment.now;
  last_good_ = moment.statistics.good;
  const Sample& sample = session.bus().latest();
  if (sample.quality() == Quality::invalid) {
    last_position_.reset();
    return moment;
  }
  moment.sample = sample;
  if (!sample.has_position()) return moment;
  if (last_position_ && sample.latch_time() > last_position_->latch) {
    const double counts =
        static_cast<double>(std::uint32_t{1} << session.profile().profile().single_turn_bits);
    const double revolutions = static_cast<double>(sample.position() - last_position_->counts) / counts;
    moment.speed_rpm = revolutions * 60.0 / seconds(sample.latch_time() - last_position_->latch);
  }
  last_position_ = Position{sample.position(), sample.latch_time()};
  return moment;
}

std::vector<std::string> monitor_block(Session& session, const Moment& moment) {
  const Statistics& statistics = moment.statistics;
  const double limit = limit_hz(session);
  std::vector<std::string> lines;
  lines.push_back(fmt::format("{}   profile {}   ID{}   {}   {:.1f} s", session.port().text(),
                              session.profile().profile().name, number(session.scheduler().id()),
                              session.clock_name(), seconds(moment.now)));
  lines.push_back(fmt::format("state      {}", state_text(moment, session)));
  add_position(lines, session, moment);
  lines.push_back(fmt::format("rate       {:>16.1f} Hz       [{}] {:.1f} % of the T1 limit", moment.rate_hz,
                              gauge(moment.rate_hz / limit, 20), moment.rate_hz * 100.0 / limit));
  lines.push_back(fmt::format("T1         {:<28} |{}| {} to {}", min_mean_max(statistics.t1),
                              bars(statistics.t1.histogram()), format_time(statistics.t1.histogram().edge(0)),
                              format_time(statistics.t1.histogram().edge(Histogram::kBins))));
  lines.push_back(fmt::format("{:<10} {:<28} |{}| {} to {}",
                              session.capability().wire_timestamps ? "T2" : "delay",
                              min_mean_max(statistics.reply_delay), bars(statistics.reply_delay.histogram()),
                              format_time(statistics.reply_delay.histogram().edge(0)),
                              format_time(statistics.reply_delay.histogram().edge(Histogram::kBins))));
  lines.push_back(fmt::format("link       {}", link_text(session.bus().link())));
  if (const StatusSet latched = session.bus().alarms().latched(); latched != session.bus().alarms().live())
    lines.push_back(fmt::format("latched    {}; 'tm485 reset errors' clears what is gone",
                                alarm_names(latched, session.profile().profile().alarms)));
  lines.push_back(fmt::format("cycles     {} good, {} failed, {} slips, {} skipped, encoder lost {} times",
                              statistics.good, statistics.failed, statistics.slips, statistics.skipped,
                              statistics.lost));
  lines.push_back(fmt::format("errors     {}", error_counts(statistics)));
  return lines;
}

std::string monitor_line(Session& session, const Moment& moment) {
  const Profile& profile = session.profile().profile();
  std::string text = fmt::format("{:7.1f} s  {}", seconds(moment.now), state_text(moment, session));
  if (moment.sample) {
    const Sample& sample = *moment.sample;
    if (sample.has_position()) text += fmt::format("  position {}", sample.position());
    if (profile.multi_turn_bits != 0) text += fmt::format("  turns {}", sample.turns());
    if (moment.speed_rpm) text += fmt::format("  {:.1f} rpm", *moment.speed_rpm);
    text += fmt::format("  alarms {}", alarm_names(sample.status(), profile.alarms));
  }
  text += fmt::format("  rate {:.1f} Hz ({:.1f} %)  T1 {}  {} {}", moment.rate_hz,
                      moment.rate_hz * 100.0 / limit_hz(session), min_mean_max(moment.statistics.t1),
                      reply_delay_name(session.capability()), min_mean_max(moment.statistics.reply_delay));
  return text + fmt::format("  link {}  errors {}", link_text(session.bus().link()),
                            error_counts(moment.statistics));
}

std::string monitor_json(Session& session, const Moment& moment) {
  const Profile& profile = session.profile().profile();
  JsonObject json;
  json.set("t_ns", moment.now.count()).set("clock", session.clock_name());
  json.set("state", moment.state == BusState::running ? "running" : "startup");
  if (moment.failure) json.set("error", moment.failure->name);
  if (moment.sample) {
    const Sample& sample = *moment.sample;
    json.set("quality", name(sample.quality()));
    if (sample.has_position()) json.set("position", sample.position()).set("abs", sample.single_turn());
    if (profile.multi_turn_bits != 0) json.set("turns", sample.turns());
    if (moment.speed_rpm) json.set("speed_rpm", *moment.speed_rpm);
    json.set("sf", sample.status().sf()).set("almc", sample.status().almc()).set("enid", sample.enid());
    json.set("alarms", status_names(sample.status()));
    if (sample.has_position()) json.set("half_width", sample.half_width());
  }
  json.set("alarms_latched", status_names(session.bus().alarms().latched()));
  json.set("link", to_json(session.bus().link()));
  const Statistics& statistics = moment.statistics;
  json.set("rate_hz", moment.rate_hz).set("rate_percent", moment.rate_hz * 100.0 / limit_hz(session));
  json.set("cycles", statistics.cycles).set("good", statistics.good).set("failed", statistics.failed);
  json.set("slips", statistics.slips).set("skipped", statistics.skipped).set("lost", statistics.lost);
  json.set("restarts", statistics.restarts).set("discontinuities", statistics.discontinuities);
  json.set("t1", to_json(statistics.t1))
      .set(reply_delay_key(session.capability()), to_json(statistics.reply_delay));
  json.set("errors", error_counts_json(statistics));
  return json.text();
}

}  // namespace tm485::cli
