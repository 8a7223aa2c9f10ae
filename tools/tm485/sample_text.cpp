#include "sample_text.hpp"

#include <fmt/format.h>

#include <iterator>

#include "json_output.hpp"
#include "quantity.hpp"

namespace tm485::cli {
namespace {

double in_units(const Session& session, const Sample& sample) {
  return to_units(sample.position(), session.axis(), session.profile().profile().single_turn_bits);
}

bool has_turns(const Session& session, const Layout& fields) {
  return fields.abm_at != 0 && session.profile().profile().multi_turn_bits != 0;
}

std::string_view unit_name(Units units) {
  return units == Units::rev ? "rev" : units == Units::deg ? "deg" : "counts";
}

}  // namespace

Units units_of(std::string_view text) noexcept {
  return text == "rev" ? Units::rev : text == "deg" ? Units::deg : Units::counts;
}

std::expected<Time, Problem> parse_period_option(const std::string& text) {
  if (text == "min") return Time{0};
  const auto period = parse_period(text);
  if (period && *period > Time{0}) return *period;
  const std::string why = period ? "it is zero" : period.error();
  return std::unexpected(
      usage_problem("bad_period", fmt::format("--period {}: {}", text, why),
                    "write a time (62.5us, 1ms), a rate (16kHz), or min for the shortest possible"));
}

std::uint32_t raw_turns(std::int32_t turns, const Profile& profile) noexcept {
  return static_cast<std::uint32_t>(turns) & ((std::uint32_t{1} << profile.multi_turn_bits) - 1U);
}

std::string sample_json(const Session& session, const Sample& sample, Errc result) {
  JsonObject json;
  json.set("t_ns", sample.latch_time().count())
      .set("sequence", sample.sequence())
      .set("quality", name(sample.quality()));
  if (result != Errc::ok) json.set("error", tm485::name(result));
  if (sample.quality() == Quality::invalid) return json.text() + '\n';
  const Layout& fields = layout(session.scheduler().id());
  if (fields.abs_at != 0) json.set("abs", sample.single_turn());
  if (has_turns(session, fields)) {
    json.set("abm", raw_turns(sample.turns(), session.profile().profile())).set("turns", sample.turns());
  }
  if (fields.abs_at != 0) {
    if (session.axis().units == Units::counts)
      json.set("position", sample.position());
    else
      json.set("position", in_units(session, sample));
    json.set("half_width", sample.half_width());
    if (sample.discontinuities() != 0) json.set("discontinuities", sample.discontinuities());
  }
  json.set("sf", sample.status().sf());
  if (fields.almc_at != 0) json.set("almc", sample.status().almc());
  if (fields.enid_at != 0) json.set("enid", sample.enid());
  return json.text() + '\n';
}

std::string sample_header(const Session& session) {
  const Layout& fields = layout(session.scheduler().id());
  std::string text = fmt::format("{:>14} {:>9} {:<7}", "t [ms]", "sequence", "quality");
  if (fields.abs_at != 0) text += fmt::format(" {:>8}", "ABS");
  if (has_turns(session, fields)) text += fmt::format(" {:>7}", "turns");
  if (fields.abs_at != 0)
    text += fmt::format(" {:>20}", fmt::format("position [{}]", unit_name(session.axis().units)));
  text += "  SF";
  if (fields.almc_at != 0) text += " ALMC";
  if (fields.enid_at != 0) text += " ENID";
  return text + '\n';
}

std::string sample_row(const Session& session, const Sample& sample, Errc result) {
  const Layout& fields = layout(session.scheduler().id());
  std::string text;
  const auto out = std::back_inserter(text);
  fmt::format_to(out, "{:>14.4f} {:>9} {:<7}", static_cast<double>(sample.latch_time().count()) / 1e6,
                 sample.sequence(), name(sample.quality()));
  if (sample.quality() != Quality::invalid) {
    if (fields.abs_at != 0) fmt::format_to(out, " {:>8}", sample.single_turn());
    if (has_turns(session, fields)) fmt::format_to(out, " {:>7}", sample.turns());
    if (fields.abs_at != 0 && session.axis().units == Units::counts)
      fmt::format_to(out, " {:>20}", sample.position());
    else if (fields.abs_at != 0)
      fmt::format_to(out, " {:>20.6f}", in_units(session, sample));
    fmt::format_to(out, "  {:02X}", sample.status().sf());
    if (fields.almc_at != 0) fmt::format_to(out, "   {:02X}", sample.status().almc());
    if (fields.enid_at != 0) fmt::format_to(out, "   {:02X}", sample.enid());
  }
  if (result != Errc::ok) fmt::format_to(out, "  {}", tm485::name(result));
  return text + '\n';
}

}  // namespace tm485::cli
