#include "any_port.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>

#include "mmio_text.hpp"
#include "tm485/linux/gpio_line.hpp"
#include "tm485/sim/sim_options.hpp"

namespace tm485::cli {
namespace {

constexpr std::string_view kSim = "sim:";
constexpr std::string_view kUnix = "unix:";
constexpr std::string_view kMmio = "mmio:";
constexpr std::string_view kDefaultProfile = "tm485_17";

/// What a thread that spins on a quiet machine is late at most.
constexpr Time kHostJitter = std::chrono::microseconds(20);

Problem bad_port(const std::string& text, std::string_view why) {
  return usage_problem(
      "bad_port", fmt::format("'{}': {}", text, why),
      fmt::format("PORT is sim: (for example sim:rpm=3000,profile=tformat_17), a serial device "
                  "such as /dev/ttyUSB0, unix:PATH, or {}",
                  mmio_usage()));
}

Problem open_problem(const linux_hal::OsError& error) {
  Problem problem{"open_failed", error.what, error.remedy, kExitFailure};
  if (!error.name.empty())
    problem.name = error.name;
  else if (error.code == Errc::port_gone)
    problem.name = "port_gone";
  if (problem.name == "chip_unfit") problem.remedy += "; --any-chip opens it all the same";
  return problem;
}

Problem bad_direction(const std::string& text, const linux_hal::DirectionConfig& direction) {
  return usage_problem(
      "bad_direction",
      fmt::format("'{}' has no driver to switch (--direction {})", text, linux_hal::to_text(direction)),
      "leave --direction out; it is for serial devices");
}

/// A UART without the kernel's driver has no kernel to switch for it; a GPIO line it may have.
std::expected<void, Problem> switch_by_gpio(const std::string& text,
                                            const linux_hal::DirectionConfig& direction,
                                            linux_hal::MmioOptions& options) {
  using Kind = linux_hal::MmioDirection::Kind;
  if (direction.kind == linux_hal::DirectionKind::automatic) return {};
  if (direction.kind == linux_hal::DirectionKind::kernel)
    return std::unexpected(usage_problem(
        "bad_direction", fmt::format("'{}' is used without the kernel's driver (--direction kernel)", text),
        "give direction=rts in the text of the port, or --direction gpio:CHIP:LINE"));
  if (options.direction.kind != Kind::automatic)
    return std::unexpected(usage_problem("bad_direction",
                                         fmt::format("'{}' and --direction both name a direction", text),
                                         "leave one of them out"));
  auto line = linux_hal::GpioLine::open(direction.gpio);
  if (!line) return std::unexpected(open_problem(line.error()));
  const auto shared = std::make_shared<linux_hal::GpioLine>(std::move(*line));
  options.direction = {Kind::call, [shared](bool on) { return shared->set(on) == 0; }};
  // One system call by a loop that may be late: as rs485_direction.hpp assumes of every GPIO line.
  if (!options.release_bound) options.release_bound = std::chrono::microseconds(100);
  return {};
}

bool is_socket(const std::string& path) {
  struct stat status{};
  return ::stat(path.c_str(), &status) == 0 && S_ISSOCK(status.st_mode);
}

/// Calls `function` with the port behind the variant.
template <class Variant, class Function>
auto with_port(Variant& port, const Function& function) noexcept {
  return std::visit(
      [&function](auto& alternative) {
        if constexpr (requires { alternative->port(); })
          return function(alternative->port());
        else
          return function(alternative);
      },
      port);
}

}  // namespace

std::expected<AnyPort::Variant, Problem> AnyPort::open_serial(const std::string& path,
                                                              const AnyPortOptions& options,
                                                              const linux_hal::DirectionConfig& direction) {
  linux_hal::SerialOptions serial;
  serial.bit_rate = options.bit_rate;
  serial.refuse_unfit_chip = !options.any_chip;
  serial.system = options.system;
  auto port = linux_hal::SerialPort::open(path, serial);
  if (!port) return std::unexpected(open_problem(port.error()));
  if (direction.kind == linux_hal::DirectionKind::automatic) return std::move(*port);
  auto control = linux_hal::Rs485Direction::open(direction, port->descriptor(), port->reopen_path());
  if (!control) return std::unexpected(open_problem(control.error()));
  linux_hal::DirectedOptions directed;
  directed.bit_rate = options.bit_rate;
  return Directed(std::move(*port), std::move(*control), directed);
}

std::expected<AnyPort::Variant, Problem> AnyPort::open_variant(const std::string& text,
                                                               const AnyPortOptions& options,
                                                               const linux_hal::DirectionConfig& direction) {
  const bool directed = direction.kind != linux_hal::DirectionKind::automatic;
  if (text == "sim" || text.starts_with(kSim)) {
    auto simulated = sim::parse_sim_options(text == "sim" ? std::string_view{}
                                                          : std::string_view(text).substr(kSim.size()));
    if (!simulated) return std::unexpected(bad_port(text, simulated.error()));
    if (directed) return std::unexpected(bad_direction(text, direction));
    simulated->line.encoder_bits_per_second = simulated->line.bits_per_second;
    simulated->line.bits_per_second = options.bit_rate;
    return std::make_shared<sim::SimulatedEncoder>(*simulated);
  }
  if (text.starts_with(kMmio)) {
    auto mmio = parse_mmio(std::string_view(text).substr(kMmio.size()));
    if (!mmio) return std::unexpected(bad_port(text, mmio.error()));
    mmio->bit_rate = options.bit_rate;
    if (auto switched = switch_by_gpio(text, direction, *mmio); !switched)
      return std::unexpected(std::move(switched.error()));
    auto port = linux_hal::MmioUart::open(*mmio);
    if (!port) return std::unexpected(open_problem(port.error()));
    return std::move(*port);
  }
  const bool named_unix = text.starts_with(kUnix);
  const std::string path = named_unix ? text.substr(kUnix.size()) : text;
  if (path.empty()) return std::unexpected(bad_port(text, "no path"));
  if (named_unix || is_socket(path)) {
    if (directed) return std::unexpected(bad_direction(text, direction));
    linux_hal::UnixOptions socket;
    socket.bit_rate = options.bit_rate;
    auto port = linux_hal::UnixPort::connect(path, socket);
    if (!port) return std::unexpected(open_problem(port.error()));
    return std::move(*port);
  }
  if (path.find('/') == std::string::npos && ::access(path.c_str(), F_OK) != 0)
    return std::unexpected(bad_port(text, "this is none of the kinds of port that there are"));
  return open_serial(path, options, direction);
}

std::expected<AnyPort, Problem> AnyPort::open(const std::string& text, const AnyPortOptions& options) {
  const auto config = linux_hal::parse_direction(options.direction);
  if (!config)
    return std::unexpected(usage_problem("bad_direction", "--" + config.error().what, config.error().remedy));
  auto port = open_variant(text, options, *config);
  if (!port) return std::unexpected(std::move(port.error()));
  if (options.virtual_time && !std::holds_alternative<Simulated>(*port)) {
    return std::unexpected(
        usage_problem("bad_virtual", fmt::format("'{}' is a real port: it cannot run in virtual time", text),
                      "leave --virtual out, or use a simulated encoder: sim:"));
  }
  return AnyPort(text, options, *config, std::move(*port));
}

AnyPort AnyPort::simulated(std::shared_ptr<sim::SimulatedEncoder> encoder, std::string name) {
  return {std::move(name), {.bit_rate = 0, .virtual_time = true}, {}, std::move(encoder)};
}

std::string AnyPort::default_profile(const std::string& text) {
  std::string_view rest = text;
  if (!rest.starts_with(kSim)) return std::string(kDefaultProfile);
  rest.remove_prefix(kSim.size());
  constexpr std::string_view kKey = "profile=";
  std::string_view profile = kDefaultProfile;
  while (!rest.empty()) {
    const std::string_view pair = rest.substr(0, rest.find(','));
    if (pair.starts_with(kKey)) profile = pair.substr(kKey.size());
    rest.remove_prefix(std::min(rest.size(), pair.size() + 1));
  }
  return std::string(profile);
}

template <class P>
std::expected<void, Problem> AnyPort::replace(P& old) {
  // What locks a device or holds a GPIO line must let go of it before the same one is asked for again.
  if constexpr (requires { old.close(); }) old.close();
  auto port = open_variant(text_, options_, direction_);
  if (!port) return std::unexpected(std::move(port.error()));
  port_ = std::move(*port);
  return {};
}

std::expected<void, Problem> AnyPort::reopen() {
  const auto opened = std::visit(
      [this](auto& port) -> std::expected<void, Problem> {
        if constexpr (requires { port.reopen(); }) {
          if (const auto again = port.reopen(); !again) return std::unexpected(open_problem(again.error()));
          return {};
        } else {
          return replace(port);
        }
      },
      port_);
  gone_ = !opened;
  return opened;
}

std::vector<Problem> AnyPort::warnings() const {
  std::vector<Problem> warnings;
  const linux_hal::SerialPort* serial = std::get_if<linux_hal::SerialPort>(&port_);
  if (const Directed* const directed = std::get_if<Directed>(&port_)) serial = &directed->port();
  if (serial == nullptr) return warnings;
  const linux_hal::LatencyTimer& timer = serial->latency_timer();
  if (timer.state == linux_hal::LatencyTimer::State::refused) {
    warnings.push_back(
        {"latency_timer",
         fmt::format(
             "{}: the latency timer stays at {} ms, so no cycle is shorter{}", text_, timer.milliseconds,
             timer.error_number == 0 ? std::string{} : fmt::format(" (errno {})", timer.error_number)),
         std::string(timer.remedy()), kExitGood});
  }
  const linux_hal::RateAbility ability = linux_hal::rate_ability(serial->identity(), options_.bit_rate);
  if (ability.verdict == linux_hal::RateVerdict::cannot) {
    const linux_hal::OsError error =
        linux_hal::chip_unfit(serial->identity(), options_.bit_rate, ability.nearest);
    warnings.push_back({std::string(error.name), error.what, error.remedy, kExitGood});
  }
  return warnings;
}

PortCapability AnyPort::capability() const noexcept {
  PortCapability capability =
      with_port(port_, [](const auto& port) { return PortCapability(port.capability()); });
  if (simulated() && !options_.virtual_time) {
    capability.jitter_margin = std::max(capability.jitter_margin, kHostJitter);
    capability.timing = TimingClass::soft;
  }
  if (latency_allowance_) capability.latency_allowance = *latency_allowance_;
  return capability;
}

std::expected<Time, Errc> AnyPort::try_send(std::span<const std::uint8_t> request, Time now) noexcept {
  const auto start = with_port(port_, [&](auto& port) { return port.try_send(request, now); });
  if (start)
    ++sends_;
  else if (start.error() == Errc::port_gone)
    gone_ = true;
  return start;
}

Transmission AnyPort::transmission(Time now) noexcept {
  return with_port(port_, [now](auto& port) { return port.transmission(now); });
}

Reception AnyPort::try_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
  const Reception reception = with_port(port_, [&](auto& port) { return port.try_receive(buffer, now); });
  if (reception.fault == Errc::port_gone) gone_ = true;
  return reception;
}

Errc AnyPort::line_fault() noexcept {
  return with_port(port_, [](auto& port) {
    if constexpr (requires { port.line_fault(); })
      return port.line_fault();
    else
      return Errc::ok;
  });
}

std::string AnyPort::direction_text() const {
  const Directed* const directed = std::get_if<Directed>(&port_);
  return directed == nullptr ? std::string() : directed->direction().description();
}

const linux_hal::TimeHistogram* AnyPort::release_times() const noexcept {
  const Directed* const directed = std::get_if<Directed>(&port_);
  return directed == nullptr || !directed->direction().by_software() ? nullptr : &directed->release_times();
}

std::uint32_t AnyPort::late_releases() const noexcept {
  const Directed* const directed = std::get_if<Directed>(&port_);
  return directed == nullptr ? 0 : directed->late_releases();
}

std::optional<std::string> AnyPort::direction_warning() const {
  const Directed* const directed = std::get_if<Directed>(&port_);
  return directed == nullptr ? std::nullopt : directed->warning();
}

Time AnyPort::next_event() noexcept {
  Simulated* const simulated = std::get_if<Simulated>(&port_);
  return simulated == nullptr ? kNever : (*simulated)->line().next_event();
}

}  // namespace tm485::cli
