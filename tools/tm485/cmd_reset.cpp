// tm485 reset: one of the encoder's three reset runs, with what it was before and after.

#include "tm485/bus/reset_run.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "ask_encoder.hpp"
#include "commands.hpp"
#include "confirm.hpp"
#include "json_output.hpp"
#include "output.hpp"
#include "session.hpp"

namespace tm485::cli {
namespace {

ResetKind kind_of(std::string_view what) {
  return what == "zero" ? ResetKind::zero : what == "multiturn" ? ResetKind::multi_turn : ResetKind::errors;
}

std::string_view name(ResetVerdict verdict) {
  switch (verdict) {
    case ResetVerdict::verified:
      return "verified";
    case ResetVerdict::cause_persists:
      return "cause_persists";
    case ResetVerdict::refused:
      return "refused";
    case ResetVerdict::failed:
      break;
  }
  return "failed";
}

std::vector<std::string_view> bit_names(StatusSet status) {
  std::vector<std::string_view> names;
  for (const StatusInfo& info : status_table())
    if (status.has(info.bit)) names.push_back(info.name);
  return names;
}

std::string bits_text(StatusSet status) {
  std::string text = fmt::format("{:02X}, {:02X}", status.sf(), status.almc());
  for (const std::string_view bit : bit_names(status)) text += fmt::format(" {}", bit);
  return text;
}

std::string angle_text(std::uint32_t abs, const Profile& profile) {
  const double turn = static_cast<double>(std::uint32_t{1} << profile.single_turn_bits);
  return fmt::format("{} counts ({:.4f} deg)", abs, static_cast<double>(abs) * 360.0 / turn);
}

/// What it will do, for the person who is asked.
std::string intent(ResetKind kind, const Frame& now, const Profile& profile) {
  const std::string turns = fmt::format("{}", now.turns(profile.multi_turn_bits));
  switch (kind) {
    case ResetKind::errors:
      return fmt::format("The latched error bits are cleared (SF, ALMC now {}); position and turns stay.",
                         bits_text(now.status()));
    case ResetKind::multi_turn:
      return fmt::format("The turn count becomes {} (now {}) and the latched error bits are cleared.",
                         profile.multi_turn_start, turns);
    case ResetKind::zero:
      break;
  }
  return fmt::format(
      "The present single-turn position, {}, becomes 0. The motor's electrical alignment moves by as much: "
      "a\n"
      "drive that commutates by this encoder must be aligned again before the motor is switched on.\n"
      "From the present zero: old offset 0, new offset {}.",
      angle_text(now.abs(), profile), angle_text(now.abs(), profile));
}

JsonObject state_json(std::uint32_t abs, std::int32_t turns, StatusSet status) {
  JsonObject json;
  json.set("abs", abs).set("turns", turns).set("sf", unsigned{status.sf()});
  json.set("almc", unsigned{status.almc()}).set("bits", bit_names(status));
  return json;
}

std::string outcome_json(Session& session, const ResetOptions& options, const ResetOutcome& outcome) {
  JsonObject json;
  json.set("port", session.port().text()).set("profile", session.profile().profile().name);
  json.set("what", options.what).set("verdict", name(outcome.verdict));
  if (outcome.code != Errc::ok) json.set("error", tm485::name(outcome.code));
  json.set("runs", unsigned{outcome.runs});
  json.set("before", state_json(outcome.abs_before, outcome.turns_before, outcome.status_before));
  // Without a look at the end there is nothing to show.
  const bool looked = outcome.verdict != ResetVerdict::failed && outcome.code != Errc::shaft_moves;
  if (looked) json.set("after", state_json(outcome.abs_after, outcome.turns_after, outcome.status_after));
  json.set("persisting", bit_names(outcome.persisting));
  if (options.what == "zero")
    json.set("old_offset", 0)
        .set("new_offset", outcome.verdict == ResetVerdict::verified ? outcome.abs_before : 0U);
  return json.text() + '\n';
}

std::string outcome_text(const ResetOptions& options, const ResetOutcome& outcome, const Profile& profile) {
  std::string text = fmt::format("{:<10} {:<32} {:<8} {}\n", "", "ABS", "turns", "SF, ALMC");
  const auto row = [&](const char* label, std::uint32_t abs, std::int32_t turns, StatusSet status) {
    text +=
        fmt::format("{:<10} {:<32} {:<8} {}\n", label, angle_text(abs, profile), turns, bits_text(status));
  };
  row("before", outcome.abs_before, outcome.turns_before, outcome.status_before);
  row("after", outcome.abs_after, outcome.turns_after, outcome.status_after);
  if (options.what == "zero")
    text += fmt::format("{:<10} old 0, new {}\n", "offset", angle_text(outcome.abs_before, profile));
  if (outcome.verdict != ResetVerdict::verified) return text;
  text += "done and verified\n";
  if (!outcome.persisting.empty())
    text += fmt::format("still reported, and ignored by profile {}: {}\n", profile.name,
                        fmt::join(bit_names(outcome.persisting), " "));
  return text;
}

Problem problem_of_outcome(const ResetOutcome& outcome, const std::string& port) {
  if (outcome.verdict == ResetVerdict::cause_persists) {
    std::string bits;
    for (const std::string_view bit : bit_names(outcome.persisting)) bits += fmt::format(" {}", bit);
    return {"cause_persists", fmt::format("{}: done, but the encoder still reports{}", port, bits),
            "remove the cause (tm485 info shows it), then reset again", kExitFailure};
  }
  const bool refused = outcome.verdict == ResetVerdict::refused;
  Problem problem = problem_of(
      outcome.code,
      fmt::format("{}: {}", port, refused ? "refused" : "failed, and what the encoder did is not known"));
  problem.exit_code = kExitFailure;
  return problem;
}

std::expected<void, Problem> ask(const ResetOptions& options, const std::string& will_do) {
  const bool zero = options.what == "zero";
  const bool answered = zero ? options.yes_realign : options.yes;
  if (!options.port.json || !answered) fmt::print(stderr, "{}\n", will_do);
  return zero ? confirm(answered, "Go on?", "realign") : confirm(answered, "Go on?", "yes");
}

}  // namespace

int run_reset(const ResetOptions& options) {
  const bool zero = options.what == "zero";
  if (const auto can =
          can_confirm(zero ? options.yes_realign : options.yes, zero ? "--yes-realign" : "--yes");
      !can)
    return report(can.error());
  SessionOptions settings;
  settings.port = options.port;
  settings.virtual_time = options.virtual_time;
  settings.cyclic = false;
  const auto opened = Session::open(settings);
  if (!opened) return report(opened.error());
  Session& session = **opened;
  if (auto started = session.wait_for_startup(); !started) {
    started.error().exit_code = kExitFailure;
    return report(started.error());
  }
  const auto present = ask_encoder(session, DataId::everything);
  if (!present) return report(present.error());
  const ResetKind kind = kind_of(options.what);
  const Profile& profile = session.profile().profile();
  if (const auto yes = ask(options, intent(kind, present->frame(), profile)); !yes)
    return report(yes.error());

  ResetConfig config;
  config.max_speed_rpm = session.axis().max_speed_rpm;
  ResetRun run(session.profile(), config);
  if (const auto begun = run.start(kind); !begun) return report(problem_of(begun.error()));
  // Not longer than some seconds, whatever the line does; Ctrl-C waits for its end, so that its effect is known.
  while (true) {
    const Time due = drive(run, session.bus(), session.now());
    if (!run.active()) break;
    (void)session.step(due);
    if (auto problem = session.failure()) {
      problem->cause += "; what the encoder did is not known";
      return report(*problem);
    }
  }
  const ResetOutcome& outcome = *run.outcome();
  const bool verified = outcome.verdict == ResetVerdict::verified;
  const bool looked = verified || outcome.verdict == ResetVerdict::cause_persists ||
                      outcome.code == Errc::reset_without_effect;
  Output output;
  if (options.port.json)
    output.write(outcome_json(session, options, outcome));
  else if (looked)
    output.write(outcome_text(options, outcome, profile));
  const int result = finish(output, kExitGood);
  if (result != kExitGood || verified) return result;
  return report(problem_of_outcome(outcome, session.port().text()));
}

}  // namespace tm485::cli
