// A UART on a register-level model with character time, as a rig of the port's contract.
#pragma once

#include <utility>

#include "conformance/port_conformance.hpp"
#include "mcu/model_access.hpp"
#include "mcu/models/uart_engine.hpp"
#include "tm485/mcu/polled_uart_port.hpp"

namespace tm485::test {

/// `M`: the model. `P`: the port over it, made by `make(model)`.
template <class M, class P>
class RegisterRig : public Rig {
 public:
  template <class Make>
  RegisterRig(const auto& config, const Make& make, Time grain, std::size_t depth)
      : model_(config), port_(make(model_)), grain_(grain), depth_(depth) {
    model_.engine().on_sent = [this](const LineCharacter& sent) {
      heard_.push_back({sent.byte, sent.start, sent.end});
    };
  }

  [[nodiscard]] M& model() { return model_; }

  PortCapability capability() override { return port_.capability(); }
  std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request) override {
    return port_.try_send(request, now());
  }
  Transmission transmission() override { return port_.transmission(now()); }
  Reception try_receive(std::span<std::uint8_t> buffer) override { return port_.try_receive(buffer, now()); }

  Time now() override { return model_.engine().now(); }
  void pass(Time span) override { model_.engine().advance_to(now() + span); }
  [[nodiscard]] Time grain() const override { return grain_; }
  [[nodiscard]] Time patience() const override { return std::chrono::milliseconds(3); }

  std::vector<HeardByte> heard() override { return std::exchange(heard_, {}); }
  void answer(std::span<const std::uint8_t> bytes, Time after) override { put(bytes, after, true); }
  /// A block that does not notice a missing stop bit is not asked to tell one.
  void without_framing_errors() { tells_framing_ = false; }
  /// A block whose transmitter has no buffer leaves gaps within a request, as long as its owner's polls are apart.
  void with_gaps(Time longest) { longest_gap_ = longest; }
  [[nodiscard]] Time longest_gap() const override { return longest_gap_; }
  bool answer_broken(std::uint8_t byte) override {
    if (!tells_framing_) return false;
    put(std::array{byte}, Time{3'000}, false);
    return true;
  }
  bool vanish() override {
    model_.vanish();
    return true;
  }

  [[nodiscard]] bool wire_time() const override { return true; }
  bool line_idle() override { return !model_.engine().transmitting() && !model_.engine().driver(); }
  [[nodiscard]] std::size_t receiver_depth() const override { return depth_; }
  std::vector<std::string> complaints() override { return model_.engine().complaints(); }

 protected:
  [[nodiscard]] P& port() { return port_; }

 private:
  void put(std::span<const std::uint8_t> bytes, Time after, bool stop_bit) {
    Time start = now() + after;
    for (const std::uint8_t byte : bytes) {
      model_.engine().arrive({byte, start, start + kCharacter, stop_bit});
      start += kCharacter;
    }
  }

  static constexpr Time kCharacter{4'000};  // of the encoder's own clock

  M model_;
  P port_;
  Time grain_;
  std::size_t depth_;
  bool tells_framing_ = true;
  Time longest_gap_{0};
  std::vector<HeardByte> heard_;
};

/// Makes a port over a model: the driver set up at 2.5 Mbit/s, as `D` switches the direction.
template <class U, class M, class D, class... Extra>
[[nodiscard]] mcu::PolledUartPort<U, D> polled_port(M& model, std::uint32_t clock_hz, D direction,
                                                    const mcu::PolledPortConfig& config, Extra... extra) {
  mcu::PolledUartPort<U, D> port(U(ModelAccess<M>(model), extra...), std::move(direction), config);
  const auto divisor = mcu::solve_baud(U::kFamily, clock_hz, 2'500'000);
  EXPECT_TRUE(divisor && port.start(*divisor));
  return port;
}

}  // namespace tm485::test
