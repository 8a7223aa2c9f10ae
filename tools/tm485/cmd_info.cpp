// tm485 info: one look at the encoder: who it is, where it is, what it complains about, how fast it answers.

#include <fmt/format.h>

#include "commands.hpp"
#include "direction_view.hpp"
#include "frame_view.hpp"
#include "json_output.hpp"
#include "output.hpp"
#include "quantity.hpp"
#include "sample_text.hpp"
#include "session.hpp"
#include "statistics_text.hpp"
#include "stop_signal.hpp"

namespace tm485::cli {
namespace {

constexpr std::uint32_t kCycles = 100;

std::string_view level_name(AlarmLevel level) {
  return level == AlarmLevel::fault ? "fault" : level == AlarmLevel::warning ? "warning" : "none";
}

std::vector<JsonObject> alarms_json(StatusSet status, const AlarmPolicy& policy) {
  std::vector<JsonObject> alarms;
  for (const StatusInfo& info : status_table()) {
    if (!status.has(info.bit)) continue;
    JsonObject alarm;
    alarm.set("name", info.name).set("field", info.field).set("level", level_name(policy.level(info.bit)));
    alarm.set("cause", info.cause).set("remedy", info.remedy);
    alarms.push_back(std::move(alarm));
  }
  return alarms;
}

std::string info_json(Session& session, const Sample& sample) {
  const Profile& profile = session.profile().profile();
  const Statistics& statistics = session.bus().statistics();
  JsonObject json;
  json.set("port", session.port().text()).set("profile", profile.name).set("enid", sample.enid());
  json.set("single_turn_bits", profile.single_turn_bits).set("multi_turn_bits", profile.multi_turn_bits);
  json.set("abs", sample.single_turn());
  if (profile.multi_turn_bits != 0)
    json.set("abm", raw_turns(sample.turns(), profile)).set("turns", sample.turns());
  json.set("position", sample.position()).set("referenced", sample.referenced());
  json.set("sf", sample.status().sf()).set("almc", sample.status().almc());
  json.set("alarm", level_name(sample.alarm())).set("alarms", alarms_json(sample.status(), profile.alarms));
  json.set(reply_delay_key(session.capability()), to_json(statistics.reply_delay));
  json.set("cycles", statistics.cycles)
      .set("failed", statistics.failed)
      .set("errors", error_counts_json(statistics));
  json.set("capability", to_json(session.capability())).set("direction", direction_json(session.port()));
  return json.text() + '\n';
}

std::string info_text(Session& session, const Sample& sample) {
  const Profile& profile = session.profile().profile();
  const Statistics& statistics = session.bus().statistics();
  std::string text;
  const auto line = [&text](std::string_view label, std::string_view value) {
    text += fmt::format("{:<12} {}\n", label, value);
  };
  line("port", session.port().text());
  line("", capability_text(session.capability()));
  if (const std::string control = session.port().direction_text(); !control.empty())
    line("direction", control);
  line("profile",
       fmt::format("{}: {} bit single-turn, {}, {}", profile.name, profile.single_turn_bits,
                   profile.multi_turn_bits == 0 ? std::string("no multi-turn")
                                                : fmt::format("{} bit multi-turn", profile.multi_turn_bits),
                   profile.battery ? "battery" : "no battery"));
  line("ENID", fmt::format("{:02X}", sample.enid()));
  line("ABS", fmt::format("{} of {} ({:.4f} deg)", sample.single_turn(),
                          std::uint32_t{1} << profile.single_turn_bits,
                          static_cast<double>(sample.single_turn()) * 360.0 /
                              static_cast<double>(std::uint32_t{1} << profile.single_turn_bits)));
  if (profile.multi_turn_bits != 0) line("turns", fmt::format("{}", sample.turns()));
  line("position", fmt::format("{} counts, {}", sample.position(),
                               sample.referenced() ? "referenced" : "not referenced"));
  line("SF, ALMC", fmt::format("{:02X}, {:02X}", sample.status().sf(), sample.status().almc()));
  if (sample.status().empty())
    line("alarms", "none");
  else
    text += "alarms\n";
  text += alarm_lines(sample.status(), profile.alarms, "  ");
  line(reply_delay_name(session.capability()),
       fmt::format("{} (min / mean / max of {})", min_mean_max(statistics.reply_delay),
                   statistics.reply_delay.count()));
  line("errors", fmt::format("{} in {} cycles", error_counts(statistics), statistics.cycles));
  if (const auto warning = session.port().direction_warning()) line("warning", *warning);
  return text;
}

}  // namespace

int run_info(const InfoOptions& options) {
  SessionOptions settings;
  settings.port = options.port;
  settings.wished_period = std::chrono::milliseconds(1);
  const auto opened = Session::open(settings);
  if (!opened) return report(opened.error());
  Session& session = **opened;
  if (const auto started = session.wait_for_startup(); !started)
    return started.error().exit_code == kExitGood ? kExitGood : report(started.error());
  std::optional<Sample> sample;
  while (!stop_requested() && session.bus().statistics().cycles < kCycles) {
    const bool recorded = session.step();
    if (const auto problem = session.failure()) return report(*problem);
    if (recorded && session.bus().latest().quality() == Quality::fresh) sample = session.bus().latest();
  }
  if (!sample)
    return report({"no_sample",
                   fmt::format("{}: not one cycle brought a sample: {}", session.port().text(),
                               error_counts(session.bus().statistics())),
                   "see the causes: tm485 bench counts them", kExitFailure});
  Output output;
  output.write(options.port.json ? info_json(session, *sample) : info_text(session, *sample));
  const int result = finish(output, kExitGood);
  if (result != kExitGood || sample->alarm() != AlarmLevel::fault) return result;
  return report(problem_of(Errc::alarm_fault, session.port().text()));
}

}  // namespace tm485::cli
