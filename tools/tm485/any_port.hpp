// AnyPort: what the PORT of a command line stands for: `sim:...`, a serial device, `unix:PATH`, `mmio:...`.
#pragma once

#include <cstdint>
#include <expected>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "problem.hpp"
#include "tm485/bus/port.hpp"
#include "tm485/linux/directed_port.hpp"
#include "tm485/linux/mmio_uart.hpp"
#include "tm485/linux/port_identity.hpp"
#include "tm485/linux/rs485_direction.hpp"
#include "tm485/linux/serial_port.hpp"
#include "tm485/linux/time_histogram.hpp"
#include "tm485/linux/unix_port.hpp"
#include "tm485/sim/simulated_encoder.hpp"
#include "tm485/time.hpp"

namespace tm485::cli {

/// How a port is opened.
struct AnyPortOptions {
  std::uint32_t bit_rate = 2'500'000;
  /// A simulated encoder is driven in virtual time; otherwise it promises what a loop that spins on the real clock can
  /// hold.
  bool virtual_time = false;
  std::string direction =
      "auto";             ///< who switches the driver of a serial device: linux_hal::parse_direction reads it
  bool any_chip = false;  ///< open also a chip that is known not to make the rate
  linux_hal::SystemPaths system = {};  ///< where the kernel says what a device is
};

/// One owner: the context of the bus. Errors and bounds of the port's functions are those of the port behind it.
class AnyPort {
 public:
  /// Opens the port of a text. Problems: bad_port, bad_direction (exit code 2: the text means nothing, or not for this
  /// port), bad_virtual (2: a real port cannot), port_gone, rate_refused, chip_unfit or open_failed (1).
  [[nodiscard]] static std::expected<AnyPort, Problem> open(const std::string& text,
                                                            const AnyPortOptions& options);

  /// A simulated encoder that its maker goes on to look at, in virtual time. It cannot be opened again.
  [[nodiscard]] static AnyPort simulated(std::shared_ptr<sim::SimulatedEncoder> encoder, std::string name);

  /// The profile that fits a port if none is given: that of `sim:profile=NAME`, otherwise tm485_17.
  [[nodiscard]] static std::string default_profile(const std::string& text);

  /// Opens the same device again, after gone(): a serial one under whatever number it has come back. On a problem it
  /// is gone.
  [[nodiscard]] std::expected<void, Problem> reopen();

  /// From now on capability() states this allowance, whatever port is behind it.
  void set_latency_allowance(Time allowance) noexcept { latency_allowance_ = allowance; }

  // The port.
  [[nodiscard]] PortCapability capability() const noexcept;
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept;
  [[nodiscard]] Transmission transmission(Time now) noexcept;
  [[nodiscard]] Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept;

  /// What the driver has counted since the last call; ok for ports that do not count.
  [[nodiscard]] Errc line_fault() noexcept;

  // What the commands need besides.
  [[nodiscard]] const std::string& text() const noexcept { return text_; }
  /// True if it lives in this process and can run in virtual time.
  [[nodiscard]] bool simulated() const noexcept { return std::holds_alternative<Simulated>(port_); }
  /// When the next bytes can be received, or kNever. Only if simulated.
  [[nodiscard]] Time next_event() noexcept;
  /// Requests that were taken since it was opened.
  [[nodiscard]] std::uint64_t sends() const noexcept { return sends_; }
  /// Where this program or the kernel switches the driver: how, for people; otherwise empty.
  [[nodiscard]] std::string direction_text() const;
  /// How late the driver was released, one value for each request; null if this program does not switch it.
  [[nodiscard]] const linux_hal::TimeHistogram* release_times() const noexcept;
  /// How many of them came after the start of the earliest reply.
  [[nodiscard]] std::uint32_t late_releases() const noexcept;
  /// See linux_hal::direction_warning().
  [[nodiscard]] std::optional<std::string> direction_warning() const;
  /// What opening has found that a person should know, each with its remedy: a latency timer that could not be set, a
  /// chip that is not fit.
  [[nodiscard]] std::vector<Problem> warnings() const;
  /// The device or the other end has vanished.
  [[nodiscard]] bool gone() const noexcept { return gone_; }

 private:
  using Simulated = std::shared_ptr<sim::SimulatedEncoder>;
  /// A serial device whose driver is switched by this program or by the kernel.
  using Directed = linux_hal::DirectedPort<linux_hal::SerialPort>;
  using Variant =
      std::variant<Simulated, linux_hal::SerialPort, Directed, linux_hal::UnixPort, linux_hal::MmioUart>;

  AnyPort(std::string text, AnyPortOptions options, linux_hal::DirectionConfig direction, Variant port)
      : text_(std::move(text)),
        options_(std::move(options)),
        direction_(std::move(direction)),
        port_(std::move(port)) {}
  [[nodiscard]] static std::expected<Variant, Problem> open_variant(
      const std::string& text, const AnyPortOptions& options, const linux_hal::DirectionConfig& direction);
  [[nodiscard]] static std::expected<Variant, Problem> open_serial(
      const std::string& path, const AnyPortOptions& options, const linux_hal::DirectionConfig& direction);

  /// Closes the port that is there and puts one of the same text in its place.
  template <class P>
  [[nodiscard]] std::expected<void, Problem> replace(P& old);

  std::string text_;
  AnyPortOptions options_;
  linux_hal::DirectionConfig direction_;
  std::optional<Time> latency_allowance_;
  Variant port_;
  std::uint64_t sends_ = 0;
  bool gone_ = false;
};

static_assert(Port<AnyPort>);

}  // namespace tm485::cli
