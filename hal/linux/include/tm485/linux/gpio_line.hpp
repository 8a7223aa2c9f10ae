// GpioLine: one output line of a GPIO chip, requested once and held: the driver-enable of an RS-485 transceiver, by
// libgpiod 1.6 or 2.x, whichever this was built with.
#pragma once

#include <expected>
#include <memory>
#include <string>
#include <string_view>

#include "tm485/linux/os_error.hpp"

namespace tm485::linux_hal {

namespace gpio_backend {
struct Line;
/// Releases the line.
struct LineCloser {
  void operator()(Line* line) const noexcept;
};
}  // namespace gpio_backend

/// Which line.
struct GpioAddress {
  /// A path (/dev/gpiochip0), a name (gpiochip0), a number (0) or a label (pinctrl-bcm2835); empty: all chips are asked
  /// for the line's name.
  std::string chip;
  std::string line;         ///< its offset in the chip (17), or its name (DE)
  bool active_low = false;  ///< active is the low level
};

struct GpioOptions {
  std::string consumer = "tm485";     ///< shown by gpioinfo; cut at 31 bytes
  std::string chip_folder = "/dev/";  ///< where chips without a path are looked for; ends in a slash
};

/// "libgpiod 1.6.3", or empty if this was built without it. Any thread.
[[nodiscard]] std::string gpio_library();

/// Movable; one owner.
class GpioLine {
 public:
  /// Requests the line as an output, inactive from the first instant. Errors, each an OsError with a remedy: no such
  /// chip; no such line, or a name that several lines have; line in use, by whom; no permission; built without
  /// libgpiod. Nothing stays open then. Any thread; allocates.
  [[nodiscard]] static std::expected<GpioLine, OsError> open(const GpioAddress& address,
                                                             const GpioOptions& options = {});

  GpioLine(GpioLine&&) noexcept = default;
  GpioLine& operator=(GpioLine&& other) noexcept;
  /// Sets the line inactive and releases it.
  ~GpioLine() { let_go(); }

  /// Sets the level: one system call, nothing allocated. Answers 0 or errno. Owner.
  [[nodiscard]] int set(bool active) noexcept;

  /// For people: "line 3 (DE) of /dev/gpiochip0, active low".
  [[nodiscard]] const std::string& description() const noexcept { return description_; }

 private:
  using Handle = std::unique_ptr<gpio_backend::Line, gpio_backend::LineCloser>;
  GpioLine(Handle line, std::string description) noexcept
      : line_(std::move(line)), description_(std::move(description)) {}
  void let_go() noexcept;

  Handle line_;
  std::string description_;
};

}  // namespace tm485::linux_hal
