// Broken twins of a port: each does one thing wrong. Private to tests/conformance.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "conformance/port_conformance.hpp"

namespace tm485::test::twins {

/// A good rig; each twin spoils one function.
class Twin : public Rig {
 public:
  explicit Twin(std::unique_ptr<Rig> good) : good_(std::move(good)) {}

  PortCapability capability() override { return good_->capability(); }
  std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request) override {
    return good_->try_send(request);
  }
  Transmission transmission() override { return good_->transmission(); }
  Reception try_receive(std::span<std::uint8_t> buffer) override { return good_->try_receive(buffer); }
  Time now() override { return good_->now(); }
  void pass(Time span) override { good_->pass(span); }
  [[nodiscard]] Time grain() const override { return good_->grain(); }
  // What a twin owes never comes: it is not waited for as long as a good port is.
  [[nodiscard]] Time patience() const override {
    return std::min<Time>(good_->patience(), std::chrono::milliseconds(200));
  }
  std::vector<HeardByte> heard() override { return good_->heard(); }
  void answer(std::span<const std::uint8_t> bytes, Time after) override { good_->answer(bytes, after); }
  bool answer_broken(std::uint8_t byte) override { return good_->answer_broken(byte); }
  bool vanish() override { return good_->vanish(); }
  [[nodiscard]] bool wire_time() const override { return good_->wire_time(); }
  bool line_idle() override { return good_->line_idle(); }
  [[nodiscard]] std::size_t receiver_depth() const override { return good_->receiver_depth(); }
  std::vector<std::string> complaints() override { return good_->complaints(); }

 protected:
  std::unique_ptr<Rig> good_;
};

using State = Transmission::State;

/// Takes "written" for "sent".
struct SentWhenWritten : Twin {
  using Twin::Twin;
  Transmission transmission() override {
    const Transmission real = good_->transmission();
    return real.state == State::sending ? Transmission{State::sent, Errc::ok} : real;
  }
};
struct NeverSent : Twin {
  using Twin::Twin;
  Transmission transmission() override {
    const Transmission real = good_->transmission();
    return real.state == State::sent ? Transmission{State::sending, Errc::ok} : real;
  }
};
struct ForgetsThatItWasSent : Twin {
  using Twin::Twin;
  Transmission transmission() override {
    const Transmission real = good_->transmission();
    return real.state == State::sent && ++asked_ % 3 == 0 ? Transmission{} : real;
  }
  int asked_ = 0;
};
struct BusyFromTheBeginning : Twin {
  using Twin::Twin;
  Transmission transmission() override {
    const Transmission real = good_->transmission();
    return real.state == State::idle ? Transmission{State::sent, Errc::ok} : real;
  }
};
struct TalksOnItsOwn : Twin {
  using Twin::Twin;
  Reception try_receive(std::span<std::uint8_t> buffer) override {
    if (++asked_ == 100) (void)good_->try_send(std::array<std::uint8_t, 1>{0x02});
    return good_->try_receive(buffer);
  }
  int asked_ = 0;
};
struct CutsRequests : Twin {
  using Twin::Twin;
  std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request) override {
    return good_->try_send(request.size() > 3 ? request.first(3) : request);
  }
};
struct LeavesAGap : Twin {
  using Twin::Twin;
  std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request) override {
    if (request.size() < 2) return good_->try_send(request);
    const auto start = good_->try_send(request.first(1));
    rest_.assign(request.begin() + 1, request.end());
    return start;
  }
  Transmission transmission() override {
    const Transmission real = good_->transmission();
    if (real.state != State::sent || rest_.empty()) return real;
    if (good_->try_send(rest_)) rest_.clear();
    return {State::sending, Errc::ok};
  }
  std::vector<std::uint8_t> rest_;
};
struct TakesEmptyRequests : Twin {
  using Twin::Twin;
  std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request) override {
    if (request.empty()) return now();
    return good_->try_send(request);
  }
};
struct SaysAStartThatIsTooLate : Twin {
  using Twin::Twin;
  std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request) override {
    const auto start = good_->try_send(request);
    return start ? std::expected<Time, Errc>(*start + Time{5'000}) : start;
  }
};
struct SaysAStartBeforeTheCall : Twin {
  using Twin::Twin;
  std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request) override {
    const auto start = good_->try_send(request);
    return start ? std::expected<Time, Errc>(*start - Time{5'000}) : start;
  }
};
struct WorksOnce : Twin {
  using Twin::Twin;
  std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request) override {
    if (std::exchange(used_, true)) return std::unexpected(Errc::send_failed);
    return good_->try_send(request);
  }
  bool used_ = false;
};
struct DropsAByte : Twin {
  using Twin::Twin;
  Reception try_receive(std::span<std::uint8_t> buffer) override {
    Reception real = good_->try_receive(buffer);
    taken_ += real.count;
    if (real.count != 0 && taken_ > 5 && !std::exchange(dropped_, true)) --real.count;
    return real;
  }
  std::size_t taken_ = 0;
  bool dropped_ = false;
};
struct HandsOutTwice : Twin {
  using Twin::Twin;
  Reception try_receive(std::span<std::uint8_t> buffer) override {
    if (again_ && !buffer.empty()) {
      buffer[0] = *again_;
      again_.reset();
      return {.count = 1};
    }
    const Reception real = good_->try_receive(buffer);
    if (real.count != 0 && ++times_ == 1) again_ = buffer[real.count - 1];
    return real;
  }
  std::optional<std::uint8_t> again_;
  int times_ = 0;
};
struct MixesTheOrder : Twin {
  using Twin::Twin;
  Reception try_receive(std::span<std::uint8_t> buffer) override {
    if (buffer.size() < 2) return good_->try_receive(buffer);
    // Two at a time, the second first.
    std::array<std::uint8_t, 1> one{};
    while (held_.size() < 2 && good_->try_receive(one).count == 1) held_.push_back(one[0]);
    if (held_.size() < 2) return {};
    buffer[0] = held_[1];
    buffer[1] = held_[0];
    held_.clear();
    return {.count = 2};
  }
  std::vector<std::uint8_t> held_;
};
struct ThrowsAwayWithAnEmptyBuffer : Twin {
  using Twin::Twin;
  Reception try_receive(std::span<std::uint8_t> buffer) override {
    if (!buffer.empty()) return good_->try_receive(buffer);
    std::array<std::uint8_t, 1> lost{};
    (void)good_->try_receive(lost);
    return {};
  }
};
/// As a terminal in its usual mode does.
struct TranslatesCarriageReturns : Twin {
  using Twin::Twin;
  Reception try_receive(std::span<std::uint8_t> buffer) override {
    const Reception real = good_->try_receive(buffer);
    std::ranges::replace(buffer.first(real.count), std::uint8_t{0x0D}, std::uint8_t{0x0A});
    return real;
  }
};
struct SmallReceiver : Twin {
  using Twin::Twin;
  void pass(Time span) override {
    good_->pass(span);
    if (span < Time{500'000}) return;
    std::array<std::uint8_t, 2> lost{};
    (void)good_->try_receive(lost);
  }
};
struct KeepsFaultsToItself : Twin {
  using Twin::Twin;
  Reception try_receive(std::span<std::uint8_t> buffer) override {
    Reception real = good_->try_receive(buffer);
    real.fault = Errc::ok;
    return real;
  }
};
struct FaultsStick : Twin {
  using Twin::Twin;
  Reception try_receive(std::span<std::uint8_t> buffer) override {
    Reception real = good_->try_receive(buffer);
    if (real.fault != Errc::ok) stuck_ = real.fault;
    if (real.count != 0) real.fault = stuck_;
    return real;
  }
  Errc stuck_ = Errc::ok;
};
struct ComesBackFromTheDead : Twin {
  using Twin::Twin;
  Reception try_receive(std::span<std::uint8_t> buffer) override {
    Reception real = good_->try_receive(buffer);
    if (real.fault == Errc::port_gone && ++told_ > 1) real.fault = Errc::ok;
    return real;
  }
  int told_ = 0;
};
struct ChangesItsMind : Twin {
  using Twin::Twin;
  PortCapability capability() override {
    PortCapability real = good_->capability();
    real.latency_allowance = now() + Time{1};
    return real;
  }
};

}  // namespace tm485::test::twins
