// tm485 sim: the simulated encoder behind a pseudo-terminal or a unix socket.

#include <fmt/format.h>

#include <numeric>
#include <string_view>

#include "commands.hpp"
#include "output.hpp"
#include "plan_text.hpp"
#include "problem.hpp"
#include "quantity.hpp"
#include "stop_signal.hpp"
#include "tm485/sim/server.hpp"
#include "tm485/sim/sim_options.hpp"

namespace tm485::cli {
namespace {

Problem server_problem(const sim::ServerError& error) {
  return {"server_failed", fmt::format("{}: {}", error.what, error.reason), error.remedy, kExitFailure};
}

std::expected<sim::SimOptions, Problem> encoder_options(const SimCommandOptions& options) {
  std::string text = fmt::format("profile={}", options.profile);
  if (!options.rpm.empty()) {
    const auto rpm = parse_rpm(options.rpm);
    if (!rpm)
      return std::unexpected(usage_problem("bad_speed", fmt::format("--rpm {}: {}", options.rpm, rpm.error()),
                                           "write a speed such as 3000 or 3000rpm"));
    text += fmt::format(",rpm={}", *rpm);
  }
  if (options.seed) text += fmt::format(",seed={}", *options.seed);
  if (!options.almc.empty()) text += fmt::format(",almc={}", options.almc);
  if (options.echo) text += ",echo=on";
  if (!options.ber.empty()) text += fmt::format(",ber={}", options.ber);
  if (!options.lost.empty()) text += fmt::format(",lost={}", options.lost);
  if (!options.boot.empty()) text += fmt::format(",boot={}", options.boot);
  if (!options.eeprom_pages.empty()) text += fmt::format(",eeprom_pages={}", options.eeprom_pages);
  if (!options.eeprom_write.empty()) text += fmt::format(",eeprom_write={}", options.eeprom_write);
  if (!options.eeprom_page.empty()) text += fmt::format(",eeprom_page={}", options.eeprom_page);
  if (!options.eeprom_fail.empty()) text += fmt::format(",eeprom_fail={}", options.eeprom_fail);
  if (options.eeprom_seed) text += fmt::format(",eeprom_seed={}", *options.eeprom_seed);
  if (options.eeprom_deaf) text += ",eeprom_deaf=on";
  const auto parsed = sim::parse_sim_options(text);
  if (!parsed)
    return std::unexpected(
        usage_problem("bad_option", parsed.error(), "tm485 sim --help shows what is possible"));
  sim::SimOptions encoder = *parsed;
  if (!options.plan.empty()) {
    auto plan = plan_from(options.plan);
    if (!plan) return std::unexpected(std::move(plan.error()));
    if (const std::string_view name = plan->not_served(); !name.empty())
      return std::unexpected(
          usage_problem("plan_not_served", fmt::format("the fault '{}' has no meaning for a server", name),
                        "leave it out, or use the simulated port in virtual time: sim:plan=..."));
    encoder.faults = std::move(*plan);
  }
  return encoder;
}

}  // namespace

int run_sim(const SimCommandOptions& options) {
  const auto encoder = encoder_options(options);
  if (!encoder) return report(encoder.error());
  auto server = options.unix_path.empty() ? sim::Server::open_pty(*encoder, options.link)
                                          : sim::Server::open_unix(*encoder, options.unix_path);
  if (!server) return report(server_problem(server.error()));
  if (!options.eeprom.empty()) {
    if (const auto kept = server->keep_eeprom(options.eeprom); !kept)
      return report(server_problem(kept.error()));
  }
  {
    Output output;
    output.write(fmt::format("{}{}\n", options.unix_path.empty() ? "" : "unix:", server->path()));
    if (const int result = finish(output, kExitGood); result != kExitGood) return result;
  }
  const auto served = server->serve(stop_flag());
  const auto& requests = server->model().statistics().requests;
  const sim::ServerStatistics& counted = server->statistics();
  const bool faults = !options.ber.empty() || !options.lost.empty() || !options.plan.empty();
  fmt::print(
      stderr, "tm485: {} requests, {} replies{}\n",
      std::accumulate(requests.begin(), requests.end(), std::uint64_t{0}), counted.replies,
      faults ? fmt::format(", {} lost, {} bits wrong", counted.replies_lost, counted.bits_flipped) : "");
  return served ? kExitGood : report(server_problem(served.error()));
}

}  // namespace tm485::cli
