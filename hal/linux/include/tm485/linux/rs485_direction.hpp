// Rs485Direction: who switches the RS-485 driver on for a request and off after it, by configuration.
//
//   auto     the transceiver, the adapter or the UART does it: nothing to do here
//   kernel   the port's driver in the kernel, by its RTS line or in hardware (TIOCSRS485)
//   gpio     this program, by a GPIO line; directed_port.hpp does the switching
//
// The encoder answers 2.8 us after the request at the earliest, so the driver must be off by then. Hardware is; a
// program or an interrupt handler as a rule is not. Each kind therefore states how late it releases, and
// direction_warning() says in plain words what that means. Specification: section 4.
#pragma once

#include <cerrno>
#include <cstdint>
#include <expected>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "tm485/linux/gpio_line.hpp"
#include "tm485/linux/os_error.hpp"
#include "tm485/time.hpp"

namespace tm485::linux_hal {

enum class DirectionKind : std::uint8_t { automatic, kernel, gpio };

struct DirectionConfig {
  DirectionKind kind = DirectionKind::automatic;
  GpioAddress gpio;      ///< gpio: the line
  bool rts_low = false;  ///< kernel: RTS is low while sending, and high otherwise
  /// kernel: the receiver is off while sending (no SER_RS485_RX_DURING_TX), so that a transceiver that hears itself
  /// does not. A driver that switches it on again by software may be too late for the reply.
  bool mute = false;
};

/// Reads `auto`, `kernel[:low][:mute]`, `gpio:CHIP:LINE[:low]` or `gpio:NAME[:low]`. Error: bad_argument with what is wrong and
/// what could be written instead. Any thread; allocates.
[[nodiscard]] std::expected<DirectionConfig, OsError> parse_direction(std::string_view text);

/// The same text again, for people: parse_direction() of it gives `config`.
[[nodiscard]] std::string to_text(const DirectionConfig& config);

/// The shortest T2 of the documents: later than this after its last stop bit, the driver talks over the encoder.
inline constexpr Time kReleaseLimit{2'800};

/// What is known of the release of the driver, from its last stop bit on.
struct ReleaseBound {
  Time bound{0};           ///< at most, on a quiet machine; 0: hardware of which nothing is known here
  bool hardware = false;   ///< no software takes part in it
  std::string_view basis;  ///< what the bound rests on; static storage
};

/// That of a driver of the kernel by its name (`stm32-usart`). Any thread; O(1).
[[nodiscard]] ReleaseBound release_of_driver(std::string_view driver) noexcept;

/// A sentence for a port whose driver is released too late, with the fixes that exist; none if it is in time or left to
/// hardware. `measured`: the longest release seen, if there was any. Any thread; allocates.
[[nodiscard]] std::optional<std::string> direction_warning(DirectionKind kind, const ReleaseBound& release,
                                                           std::optional<Time> measured = {},
                                                           Time limit = kReleaseLimit);

/// The RS-485 mode of a tty's driver; puts the mode from before back at its end, so it must not outlive the descriptor.
class KernelRs485 {
 public:
  /// Sets the mode and reads it back. Errors: an OsError (ENOTTY: the driver has none), also for a flag or a delay that
  /// the driver has not kept; the mode from before is put back then. Any thread; system calls.
  [[nodiscard]] static std::expected<KernelRs485, OsError> set(int fd, const std::string& path, bool rts_low,
                                                               bool mute);

  KernelRs485(KernelRs485&& other) noexcept;
  KernelRs485& operator=(KernelRs485&& other) noexcept;
  ~KernelRs485() { restore(); }

 private:
  /// A copy of the kernel's serial_rs485.
  struct Mode {
    std::uint32_t words[8] = {};
  };
  KernelRs485(int fd, const Mode& before) noexcept : fd_(fd), before_(before) {}
  void restore() noexcept;

  int fd_ = -1;
  Mode before_;
};

/// Movable; one owner. Must not outlive the port's descriptor.
class Rs485Direction {
 public:
  /// Nothing to switch.
  Rs485Direction() noexcept = default;

  /// Makes ready what `config` asks for: the kernel's mode of the tty `fd`, or the GPIO line, inactive. Errors: an
  /// OsError; nothing has changed then. `path` is for its text. Any thread; allocates.
  [[nodiscard]] static std::expected<Rs485Direction, OsError> open(const DirectionConfig& config, int fd,
                                                                   const std::string& path,
                                                                   const GpioOptions& gpio = {});

  /// Puts back and releases what it has: before the port is closed to be opened again.
  void let_go() noexcept { means_.emplace<std::monostate>(); }
  /// Makes it ready again for the port's new descriptor. Errors: as open().
  [[nodiscard]] std::expected<void, OsError> open_again(int fd);

  [[nodiscard]] DirectionKind kind() const noexcept { return config_.kind; }
  /// True if somebody has to call enable() and release().
  [[nodiscard]] bool by_software() const noexcept { return config_.kind == DirectionKind::gpio; }
  /// Driver on, driver off: 0 or errno (ENODEV after let_go()). One system call; none if not by_software(). Owner.
  [[nodiscard]] int enable() noexcept { return switch_to(true); }
  [[nodiscard]] int release() noexcept { return switch_to(false); }

  [[nodiscard]] const ReleaseBound& release_bound() const noexcept { return bound_; }
  /// For people: "GPIO line 3 (DE) of /dev/gpiochip0".
  [[nodiscard]] std::string description() const;

 private:
  [[nodiscard]] int switch_to(bool driving) noexcept {
    GpioLine* const line = std::get_if<GpioLine>(&means_);
    if (line != nullptr) return line->set(driving);
    return by_software() ? kLetGo : 0;
  }

  static constexpr int kLetGo = ENODEV;

  DirectionConfig config_;
  GpioOptions gpio_;
  std::string path_;  ///< of the port
  ReleaseBound bound_;
  std::string driver_;  ///< kernel: its name, if the system says
  std::variant<std::monostate, KernelRs485, GpioLine> means_;
};

}  // namespace tm485::linux_hal
