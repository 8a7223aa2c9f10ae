// The 16550's driver on a model of its registers.
#include "tm485/mcu/uart16550.hpp"

#include <gtest/gtest.h>

#include <array>
#include <optional>
#include <vector>

#include "mcu/model_access.hpp"
#include "mcu/models/uart16550_model.hpp"

namespace tm485::test {
namespace {

using Driver = mcu::Uart16550<ModelAccess<Uart16550Model>>;

constexpr auto kDivisor = *mcu::solve_baud(mcu::BaudFamily::ns16550, 40'000'000, 2'500'000);

class Uart16550Test : public testing::Test {
 protected:
  void make(const Uart16550Config& config) {
    model_.emplace(config);
    driver_.emplace(ModelAccess(*model_), mcu::Layout16550{static_cast<std::uint8_t>(config.shift),
                                                           static_cast<std::uint8_t>(config.width)});
    model_->engine().on_sent = [this](const LineCharacter& character) { sent_.push_back(character); };
  }
  void make_and_configure(const Uart16550Config& config = {}) {
    make(config);
    ASSERT_TRUE(driver_->configure(kDivisor));
  }
  void TearDown() override {
    if (model_) {
      EXPECT_EQ(model_->engine().complaints(), std::vector<std::string>{});
    }
  }
  UartEngine& engine() { return model_->engine(); }
  void arrive(std::uint8_t byte, Time start, bool stop_bit = true) {
    engine().arrive({byte, start, start + Time{4'000}, stop_bit});
  }

  std::optional<Uart16550Model> model_;
  std::optional<Driver> driver_;
  std::vector<LineCharacter> sent_;
};

TEST(Layout16550, SaysWhatIsPossible) {
  using mcu::Layout16550;
  EXPECT_TRUE(Layout16550{}.valid());
  EXPECT_TRUE((Layout16550{.shift = 2, .width = 1}.valid()));
  EXPECT_TRUE((Layout16550{.shift = 2, .width = 4}.valid()));
  EXPECT_FALSE((Layout16550{.shift = 1, .width = 4}.valid()));
  EXPECT_FALSE((Layout16550{.shift = 3, .width = 1}.valid()));
  EXPECT_FALSE((Layout16550{.shift = 2, .width = 3}.valid()));
  EXPECT_EQ((Layout16550{.shift = 2, .width = 4}.span()), 32U);
}

TEST_F(Uart16550Test, IsSetUpInEveryLayout) {
  for (const auto& [shift, width] : {std::pair{0U, 1U}, {1U, 1U}, {1U, 2U}, {2U, 1U}, {2U, 2U}, {2U, 4U}}) {
    make_and_configure({.shift = shift, .width = width});
    EXPECT_EQ(model_->divisor(), 1U);
    EXPECT_TRUE(driver_->transmitter_idle());
    EXPECT_FALSE(driver_->try_read().present);
    EXPECT_EQ(engine().complaints(), std::vector<std::string>{}) << shift << " " << width;
  }
}

TEST_F(Uart16550Test, ADivisorOfTwoBytesIsSet) {
  make({.clock_hz = 1'000'000'000});
  const auto divisor = mcu::solve_baud(mcu::BaudFamily::ns16550, 1'000'000'000, 100'000);
  ASSERT_TRUE(divisor);
  ASSERT_TRUE(driver_->configure(*divisor));
  EXPECT_EQ(model_->divisor(), 625U);
}

TEST_F(Uart16550Test, AUartWithoutFifosIsRefused) {
  make({.fifos = false});
  EXPECT_EQ(driver_->configure(kDivisor), std::unexpected(Errc::bad_argument));
}

TEST_F(Uart16550Test, SendsInOrderAndIsBusyUntilTheStopBit) {
  make_and_configure();
  for (const std::uint8_t byte : std::array<std::uint8_t, 4>{0x32, 0x05, 0xA5, 0x92})
    ASSERT_TRUE(driver_->try_write(byte));
  Time last{0};
  while (!driver_->transmitter_idle() && last < Time{100'000}) {
    last = engine().now();
    engine().advance_to(last + Time{50});
  }
  ASSERT_EQ(sent_.size(), 4U);
  EXPECT_EQ(sent_[3].byte, 0x92);
  EXPECT_LT(last, sent_[3].end);
  EXPECT_LE(sent_[3].end, engine().now());
}

TEST_F(Uart16550Test, AFullFifoTakesNoMore) {
  make_and_configure();
  int taken = 0;
  for (int i = 0; i < 100; ++i) taken += driver_->try_write(0x55) ? 1 : 0;
  EXPECT_EQ(taken, 16);  // there is no flag for "full": it is left to run empty
  engine().advance_to(Time{100'000});
  EXPECT_TRUE(driver_->try_write(0x55));
}

TEST_F(Uart16550Test, UnsentBytesCanBeDropped) {
  make_and_configure();
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(driver_->try_write(0x55));
  driver_->drop_unsent();
  engine().advance_to(Time{100'000});
  EXPECT_EQ(sent_.size(), 1U);  // it had begun
  ASSERT_TRUE(driver_->try_write(0xAA));
  engine().advance_to(Time{200'000});
  EXPECT_EQ(sent_.back().byte, 0xAA);
}

/// Reading the line status clears it: who asks for the transmitter must not lose what the receiver has to say.
TEST_F(Uart16550Test, AnErrorOutlivesAQuestionAboutTheTransmitter) {
  make_and_configure();
  arrive(0x55, Time{0}, false);
  arrive(0xA5, Time{4'000});
  engine().advance_to(Time{10'000});
  EXPECT_TRUE(driver_->transmitter_idle());
  EXPECT_EQ(driver_->try_read().fault, Errc::framing_error);
  EXPECT_TRUE(driver_->transmitter_idle());
  const mcu::ReceivedCharacter good = driver_->try_read();
  EXPECT_EQ(good.byte, 0xA5);
  EXPECT_EQ(good.fault, Errc::ok);
  arrive(0x00, Time{12'000}, false);
  engine().advance_to(Time{20'000});
  EXPECT_EQ(driver_->try_read().fault, Errc::framing_error);
}

TEST_F(Uart16550Test, AnOverrunIsToldOnce) {
  make_and_configure();
  for (int i = 0; i < 20; ++i) arrive(static_cast<std::uint8_t>(i), Time{4'000 * i});
  engine().advance_to(Time{100'000});
  EXPECT_TRUE(driver_->transmitter_idle());  // reads the status, and so clears it
  for (int i = 0; i < 16; ++i) {
    const mcu::ReceivedCharacter character = driver_->try_read();
    EXPECT_EQ(character.byte, i);
    EXPECT_EQ(character.fault, Errc::ok);
  }
  EXPECT_TRUE(driver_->take_overrun());
  EXPECT_FALSE(driver_->take_overrun());
}

TEST_F(Uart16550Test, NobodyThereIsPortGone) {
  make({.present = false});
  EXPECT_EQ(driver_->configure(kDivisor), std::unexpected(Errc::port_gone));
  make({.keeps = false});
  EXPECT_EQ(driver_->configure(kDivisor), std::unexpected(Errc::port_gone));
  make_and_configure();
  model_->vanish();
  EXPECT_EQ(driver_->try_read().fault, Errc::port_gone);
}

}  // namespace
}  // namespace tm485::test
