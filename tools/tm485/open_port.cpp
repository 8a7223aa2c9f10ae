#include "open_port.hpp"

#include <fmt/format.h>

#include <optional>

#include "quantity.hpp"

namespace tm485::cli {
namespace {

/// An allowance beyond this would only hide an encoder that is silent.
constexpr Time kLongestLatency = std::chrono::seconds(10);

std::expected<std::optional<Time>, Problem> latency_of(const std::string& text) {
  if (text.empty()) return std::nullopt;
  const auto latency = parse_time(text, PlainNumber::refused);
  if (latency && *latency <= kLongestLatency) return *latency;
  return std::unexpected(usage_problem(
      "bad_latency", fmt::format("--latency {}: {}", text, latency ? "it is above 10 s" : latency.error()),
      "write a time such as 100ms"));
}

}  // namespace

std::expected<AnyPort, Problem> open_port(const PortOptions& options, std::uint32_t bit_rate,
                                          bool virtual_time) {
  const auto latency = latency_of(options.latency);
  if (!latency) return std::unexpected(latency.error());
  auto port = AnyPort::open(options.port, {.bit_rate = bit_rate,
                                           .virtual_time = virtual_time,
                                           .direction = options.direction,
                                           .any_chip = options.any_chip,
                                           .system = options.system});
  if (port && *latency) port->set_latency_allowance(**latency);
  return port;
}

}  // namespace tm485::cli
