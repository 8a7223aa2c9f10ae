// Stacks that are broken on purpose: what stands between the bus and the simulated port, and profiles with a wrong number.
// The campaign has to find each of them out.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <memory>
#include <span>

#include "tm485/bus/eeprom.hpp"
#include "tm485/bus/port.hpp"
#include "tm485/protocol/profile.hpp"
#include "tm485/sim/sim_port.hpp"

namespace tm485::test {

/// A port that does everything as the good one; each twin spoils one function.
class TwinPort {
 public:
  explicit TwinPort(sim::SimPort& port) : good_(&port) {}

  [[nodiscard]] PortCapability capability() const noexcept { return good_->capability(); }
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    return good_->try_send(request, now);
  }
  [[nodiscard]] Transmission transmission(Time now) const noexcept { return good_->transmission(now); }
  [[nodiscard]] Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
    return good_->try_receive(buffer, now);
  }

 protected:
  sim::SimPort* good_;
};

/// The stack without its CRC check: whatever arrives whole gets the CRC that belongs to it.
class NoCrcCheck : public TwinPort {
 public:
  using TwinPort::TwinPort;
  [[nodiscard]] Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
    const Reception reception = good_->try_receive(buffer, now);
    if (reception.count != 11 && reception.count != 6) return reception;
    std::uint8_t sum = 0;
    for (std::size_t k = 0; k + 1 < reception.count; ++k) sum = static_cast<std::uint8_t>(sum ^ buffer[k]);
    buffer[reception.count - 1] = sum;
    return reception;
  }
};

/// The stack without its check of CF: what has the right length gets the CF that was asked for, and the CRC follows.
class NoCfCheck : public TwinPort {
 public:
  using TwinPort::TwinPort;
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    asked_ = request[0];
    return good_->try_send(request, now);
  }
  [[nodiscard]] Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
    const Reception reception = good_->try_receive(buffer, now);
    if (reception.count != 11 && reception.count != 6) return reception;
    buffer[reception.count - 1] = static_cast<std::uint8_t>(buffer[reception.count - 1] ^ buffer[0] ^ asked_);
    buffer[0] = asked_;
    return reception;
  }

 private:
  std::uint8_t asked_ = 0;
};

/// Waits ten cycles for a reply that does not come: the port claims to hand bytes over that late.
class LateTimeout : public TwinPort {
 public:
  using TwinPort::TwinPort;
  [[nodiscard]] PortCapability capability() const noexcept {
    PortCapability c = good_->capability();
    c.latency_allowance = std::chrono::microseconds(400);
    return c;
  }
};

/// Waits for ever.
class NoTimeout : public TwinPort {
 public:
  using TwinPort::TwinPort;
  [[nodiscard]] PortCapability capability() const noexcept {
    PortCapability c = good_->capability();
    c.latency_allowance = std::chrono::hours(1);
    return c;
  }
};

/// A missing reply is replaced by the last one.
class RepeatsTheLastReply : public TwinPort {
 public:
  using TwinPort::TwinPort;
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    const auto start = good_->try_send(request, now);
    if (start) end_ = *start + Time{4'000} * static_cast<std::int64_t>(request.size());
    waiting_ = start.has_value() && request[0] == last_[0];
    return start;
  }
  [[nodiscard]] Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
    const Reception reception = good_->try_receive(buffer, now);
    if (reception.count != 0) {
      waiting_ = false;
      if (reception.count == 11 || reception.count == 6) {
        count_ = reception.count;
        std::copy_n(buffer.begin(), count_, last_.begin());
      }
      return reception;
    }
    const Time done = end_ + Time{3'000} + Time{4'000} * static_cast<std::int64_t>(count_);
    if (!waiting_ || now <= done || count_ == 0) return reception;
    waiting_ = false;
    std::copy_n(last_.begin(), count_, buffer.begin());
    return {.count = count_, .first_start = end_ + Time{3'000}};
  }

 private:
  std::array<std::uint8_t, 11> last_{};
  std::size_t count_ = 0;
  Time end_{0};
  bool waiting_ = false;
};

/// Says that a request left 2 us after it did.
class WrongTimestamps : public TwinPort {
 public:
  using TwinPort::TwinPort;
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    const auto start = good_->try_send(request, now);
    return start ? std::expected<Time, Errc>(*start + kLater) : start;
  }
  [[nodiscard]] Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
    Reception reception = good_->try_receive(buffer, now);
    reception.first_start += kLater;
    return reception;
  }

 private:
  static constexpr Time kLater{2'000};
};

/// Starts each request 6 us late, and says so.
class StartsLate : public TwinPort {
 public:
  using TwinPort::TwinPort;
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    return good_->try_send(request, now + Time{6'000});
  }
};

/// Allocates now and then.
class UsesTheHeap : public TwinPort {
 public:
  using TwinPort::TwinPort;
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    kept_ = std::make_unique<char[]>(request.size());
    return good_->try_send(request, now);
  }

 private:
  std::unique_ptr<char[]> kept_;
};

/// Selects a page and goes on as if it stayed selected: after a restart of the encoder it is another one.
struct NeverLooksAtThePage : EepromDiscipline {
  static constexpr bool kChecksPage = false;
};

/// Takes a write for done when its reply is there.
struct NeverLooksAtWhatItWrote : EepromDiscipline {
  static constexpr bool kReadsBack = false;
  static constexpr bool kComparesEcho = false;
};

/// T1 too short by an eighth. Half of it is no profile: an exchange would not fit.
inline void shorten_t1(Profile& profile) {
  for (Time& t1 : profile.t1) t1 = t1 * 7 / 8;
}

/// Takes the encoder's silence for a bad line however long it lasts.
inline void never_think_of_a_restart(Profile& profile) { profile.boot_time_min = profile.power_up_time; }

}  // namespace tm485::test
