// Ports that do one thing wrong each. The check that is there for it must find it, or the suite proves nothing.
#include <algorithm>
#include <array>
#include <optional>
#include <string_view>
#include <utility>

#include "conformance/register_rig.hpp"
#include "conformance/rigs.hpp"
#include "conformance/twins.hpp"
#include "mcu/models/pl011_model.hpp"
#include "tm485/mcu/pl011.hpp"

namespace tm485::test {
namespace {

using namespace twins;

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
