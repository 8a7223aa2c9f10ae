// Broken twins: ports that do one thing wrong each. The check that is there for it must find it, or the suite proves
// nothing.
#include <algorithm>
#include <array>
#include <optional>
#include <string_view>
#include <utility>

#include "conformance/register_rig.hpp"
#include "conformance/rigs.hpp"
#include "mcu/models/pl011_model.hpp"
#include "tm485/mcu/pl011.hpp"

namespace tm485::test {
namespace {

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

// Twins of the hardware: the port is the real one, the registers or the direction are not right.

/// A PL011 whose BUSY covers the FIFO only: what a driver that looks at "FIFO empty" sees.
class ForgetsTheShiftRegister {
 public:
  explicit ForgetsTheShiftRegister(Pl011Model& model) noexcept : model_(&model) {}
  std::uint8_t read8(std::size_t offset) noexcept { return model_->read8(offset); }
  std::uint16_t read16(std::size_t offset) noexcept { return model_->read16(offset); }
  std::uint32_t read32(std::size_t offset) noexcept {
    const std::uint32_t value = model_->read32(offset);
    return offset == 0x18 && (value & 0x80U) != 0 ? value & ~0x08U : value;
  }
  void write8(std::size_t offset, std::uint8_t value) noexcept { model_->write8(offset, value); }
  void write16(std::size_t offset, std::uint16_t value) noexcept { model_->write16(offset, value); }
  void write32(std::size_t offset, std::uint32_t value) noexcept { model_->write32(offset, value); }

 private:
  Pl011Model* model_;
};

/// A direction that does not release, or never drives.
struct LazyPin {
  Pl011Model* model;
  bool on_works;
  bool off_works;
  bool operator()(bool on) noexcept {
    if (on ? on_works : off_works) model->engine().set_driver(on);
    return true;
  }
};

constexpr EngineConfig kSlowStart{.start_delay = Time{400}, .access = Time{20}, .judge_driver = true};
constexpr PortCapability kCapability{.release_bound = Time{1'000}};

std::unique_ptr<Rig> early_release_rig() {
  using Driver = mcu::Pl011<ForgetsTheShiftRegister>;
  using Direction = mcu::CallDirection<ModelDriverPin<Pl011Model>>;
  using Port = mcu::PolledUartPort<Driver, Direction>;
  return std::make_unique<RegisterRig<Pl011Model, Port>>(
      Pl011Config{.engine = kSlowStart},
      [](Pl011Model& model) {
        Port port(Driver(ForgetsTheShiftRegister(model)), Direction{ModelDriverPin(model)},
                  {.capability = kCapability});
        EXPECT_TRUE(port.start(*mcu::solve_baud(Driver::kFamily, 48'000'000, 2'500'000)));
        return port;
      },
      Time{100}, 32);
}

template <bool OnWorks, bool OffWorks>
std::unique_ptr<Rig> lazy_pin_rig() {
  using Driver = mcu::Pl011<ModelAccess<Pl011Model>>;
  using Direction = mcu::CallDirection<LazyPin>;
  using Port = mcu::PolledUartPort<Driver, Direction>;
  return std::make_unique<RegisterRig<Pl011Model, Port>>(
      Pl011Config{.engine = kSlowStart},
      [](Pl011Model& model) {
        return polled_port<Driver>(model, 48'000'000, Direction{LazyPin{&model, OnWorks, OffWorks}},
                                   {.capability = kCapability});
      },
      Time{100}, 32);
}

/// The owner polls every 9 us only: the driver is off the line too late.
std::unique_ptr<Rig> lazy_owner_rig() {
  using Driver = mcu::Pl011<ModelAccess<Pl011Model>>;
  using Direction = mcu::CallDirection<ModelDriverPin<Pl011Model>>;
  using Port = mcu::PolledUartPort<Driver, Direction>;
  return std::make_unique<RegisterRig<Pl011Model, Port>>(
      Pl011Config{.engine = kSlowStart},
      [](Pl011Model& model) {
        return polled_port<Driver>(model, 48'000'000, Direction{ModelDriverPin(model)},
                                   {.capability = kCapability});
      },
      Time{9'000}, 32);
}

template <class T>
std::unique_ptr<Rig> of_sim() {
  return std::make_unique<T>(make_sim_rig());
}
template <class T>
std::unique_ptr<Rig> of_pl011() {
  return std::make_unique<T>(make_pl011_rig());
}
template <class T>
std::unique_ptr<Rig> of_terminal() {
  return std::make_unique<T>(make_pseudo_terminal_rig());
}

struct BrokenTwin {
  const char* name;
  const char* check;
  RigFactory make;
  friend void PrintTo(const BrokenTwin& twin, std::ostream* out) { *out << twin.name; }
};

constexpr std::array kTwins{
    BrokenTwin{"SentWhenWritten", "sent_means_off_the_line", of_sim<SentWhenWritten>},
    BrokenTwin{"SentWhenWrittenOnRegisters", "sent_means_off_the_line", of_pl011<SentWhenWritten>},
    BrokenTwin{"NeverSent", "sent_means_off_the_line", of_sim<NeverSent>},
    BrokenTwin{"ForgetsThatItWasSent", "sent_means_off_the_line", of_sim<ForgetsThatItWasSent>},
    BrokenTwin{"BusyFromTheBeginning", "a_fresh_port_is_idle", of_sim<BusyFromTheBeginning>},
    BrokenTwin{"TalksOnItsOwn", "a_fresh_port_is_idle", of_sim<TalksOnItsOwn>},
    BrokenTwin{"TalksOnItsOwnLater", "sends_the_request_and_nothing_else", of_sim<TalksOnItsOwn>},
    BrokenTwin{"TalksOnItsOwnOnATerminal", "sends_the_request_and_nothing_else", of_terminal<TalksOnItsOwn>},
    BrokenTwin{"CutsRequests", "sends_the_request_and_nothing_else", of_sim<CutsRequests>},
    BrokenTwin{"LeavesAGap", "a_request_is_one_gapless_burst", of_sim<LeavesAGap>},
    BrokenTwin{"TakesEmptyRequests", "an_empty_request_is_refused", of_sim<TakesEmptyRequests>},
    BrokenTwin{"SaysAStartThatIsTooLate", "the_start_is_that_of_the_start_bit",
               of_sim<SaysAStartThatIsTooLate>},
    BrokenTwin{"SaysAStartThatIsTooLateOnRegisters", "the_start_is_that_of_the_start_bit",
               of_pl011<SaysAStartThatIsTooLate>},
    BrokenTwin{"SaysAStartBeforeTheCall", "the_start_is_that_of_the_start_bit",
               of_terminal<SaysAStartBeforeTheCall>},
    BrokenTwin{"WorksOnce", "requests_follow_one_another", of_sim<WorksOnce>},
    BrokenTwin{"CutsRequestsUnderWay", "a_request_under_way_is_not_disturbed", of_sim<CutsRequests>},
    BrokenTwin{"DropsAByte", "bytes_come_once_and_in_order", of_sim<DropsAByte>},
    BrokenTwin{"DropsAByteOnRegisters", "no_byte_is_lost_in_short_cycles", of_pl011<DropsAByte>},
    BrokenTwin{"DropsAByteOnATerminal", "bytes_come_once_and_in_order", of_terminal<DropsAByte>},
    BrokenTwin{"HandsOutTwice", "bytes_come_once_and_in_order", of_sim<HandsOutTwice>},
    BrokenTwin{"HandsOutTwiceOnATerminal", "bytes_come_once_and_in_order", of_terminal<HandsOutTwice>},
    BrokenTwin{"MixesTheOrder", "bytes_come_once_and_in_order", of_sim<MixesTheOrder>},
    BrokenTwin{"ThrowsAwayWithAnEmptyBuffer", "an_empty_buffer_takes_nothing",
               of_pl011<ThrowsAwayWithAnEmptyBuffer>},
    BrokenTwin{"TranslatesCarriageReturns", "every_byte_value_passes",
               of_terminal<TranslatesCarriageReturns>},
    BrokenTwin{"SmallReceiver", "a_late_reader_loses_nothing", of_pl011<SmallReceiver>},
    BrokenTwin{"HidesAFramingError", "a_character_without_a_stop_bit_is_told", of_pl011<KeepsFaultsToItself>},
    BrokenTwin{"HidesAnOverrun", "lost_bytes_are_told", of_pl011<KeepsFaultsToItself>},
    BrokenTwin{"AFramingErrorSticks", "a_character_without_a_stop_bit_is_told", of_pl011<FaultsStick>},
    BrokenTwin{"AnOverrunSticks", "lost_bytes_are_told", of_pl011<FaultsStick>},
    BrokenTwin{"HidesThatItIsGone", "a_port_that_is_gone_says_so", of_terminal<KeepsFaultsToItself>},
    BrokenTwin{"ComesBackFromTheDead", "a_port_that_is_gone_says_so", of_pl011<ComesBackFromTheDead>},
    BrokenTwin{"ChangesItsMind", "capability_is_a_constant", of_sim<ChangesItsMind>},
    BrokenTwin{"ReleasesEarly", "sent_means_off_the_line", early_release_rig},
    BrokenTwin{"NeverReleases", "sent_means_off_the_line", lazy_pin_rig<true, false>},
    BrokenTwin{"NeverDrives", "sends_the_request_and_nothing_else", lazy_pin_rig<false, true>},
    BrokenTwin{"ReleasesLate", "no_byte_is_lost_in_short_cycles", lazy_owner_rig},
};

class BrokenTwins : public testing::TestWithParam<BrokenTwin> {};

TEST_P(BrokenTwins, AreFound) {
  const BrokenTwin& twin = GetParam();
  const std::unique_ptr<Rig> rig = twin.make();
  const Violations found = run_check(port_check(twin.check), *rig);
  EXPECT_FALSE(found.empty()) << twin.check << " finds nothing wrong with it";
}

std::string twin_name(const testing::TestParamInfo<BrokenTwin>& twin) { return twin.param.name; }

INSTANTIATE_TEST_SUITE_P(All, BrokenTwins, testing::ValuesIn(kTwins), twin_name);

TEST(BrokenTwinsTable, HasOneForEachCheck) {
  for (const Check& check : port_checks()) {
    EXPECT_TRUE(std::ranges::any_of(kTwins, [&check](const BrokenTwin& twin) {
      return std::string_view(twin.check) == check.name;
    })) << check.name;
  }
}

}  // namespace
}  // namespace tm485::test
