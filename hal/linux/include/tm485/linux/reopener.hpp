// Reopener: brings a port back that was unplugged, and the bus on it.
//
// The bus goes on by itself while the port is gone: it reports port_gone and holds the sample until it is invalid. What it
// cannot do is open a device; this does, beside it, in the same context.
#pragma once

#include <chrono>
#include <cstdint>

#include "tm485/time.hpp"

namespace tm485::linux_hal {

/// One owner: the context of the bus. Waits for nothing.
class Reopener {
 public:
  enum class Event : std::uint8_t {
    none,
    gone,  ///< told once: the port has vanished
    back,  ///< told once: it is open again, and the bus has begun its start-up
  };

  /// `every`: how long between two attempts, above 0.
  explicit Reopener(Time every = std::chrono::milliseconds(500)) noexcept : every_(every) {}

  /// To be called between two polls of the bus. Costs nothing while the port is there; when it is gone, now and then one
  /// attempt to open it: system calls and the heap, but then there is no cycle to disturb. `port` has gone() and
  /// reopen(), as SerialPort has; `bus` is the one on it.
  template <class P, class B>
  Event tend(P& port, B& bus, Time now) {
    if (!port.gone()) [[likely]]
      return Event::none;
    if (!told_) {
      told_ = true;
      next_ = now;
      return Event::gone;
    }
    if (now < next_) return Event::none;
    next_ = now + every_;
    if (!port.reopen()) return Event::none;
    told_ = false;
    if (times_ < UINT32_MAX) ++times_;
    bus.on_restart(now);
    return Event::back;
  }

  /// When tend() has something to do; only while the port is gone.
  [[nodiscard]] Time next() const noexcept { return next_; }
  /// How often the port has come back.
  [[nodiscard]] std::uint32_t times() const noexcept { return times_; }

 private:
  Time every_;
  Time next_{0};
  std::uint32_t times_ = 0;
  bool told_ = false;
};

}  // namespace tm485::linux_hal
