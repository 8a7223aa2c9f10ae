// The PL011's driver on a model of its registers.
#include "tm485/mcu/pl011.hpp"

#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "mcu/model_access.hpp"
#include "mcu/models/pl011_model.hpp"

namespace tm485::test {
namespace {

using Driver = mcu::Pl011<ModelAccess<Pl011Model>>;

constexpr auto kDivisor = *mcu::solve_baud(mcu::BaudFamily::pl011, 48'000'000, 2'500'000);

class Pl011Test : public testing::Test {
 protected:
  void make(const Pl011Config& config) {
    model_.emplace(config);
    driver_.emplace(ModelAccess(*model_));
    model_->engine().on_sent = [this](const LineCharacter& character) { sent_.push_back(character); };
  }
  void make_and_configure(const Pl011Config& config = {}) {
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

  std::optional<Pl011Model> model_;
  std::optional<Driver> driver_;
  std::vector<LineCharacter> sent_;
};

TEST_F(Pl011Test, IsSetUpAsTheManualSays) {
  make_and_configure();
  EXPECT_EQ(model_->integer_divisor(), 1U);
  EXPECT_EQ(model_->fractional_divisor(), 13U);
  EXPECT_EQ(model_->control(), 0x301U);
  EXPECT_TRUE(driver_->transmitter_idle());
  EXPECT_FALSE(driver_->try_read().present);
}

TEST_F(Pl011Test, WhatWasThereBeforeIsGone) {
  make_and_configure();
  arrive(0x11, Time{0});
  engine().advance_to(Time{5'000});
  ASSERT_TRUE(driver_->configure(kDivisor));
  EXPECT_FALSE(driver_->try_read().present);
}

TEST_F(Pl011Test, SendsInOrderAndIsBusyUntilTheStopBit) {
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

TEST_F(Pl011Test, AFullFifoTakesNoMore) {
  make_and_configure({.depth = 16});
  int taken = 0;
  while (taken < 100 && driver_->try_write(0x55)) ++taken;
  EXPECT_EQ(taken, 17);  // one is in the shift register
}

TEST_F(Pl011Test, UnsentBytesCanBeDropped) {
  make_and_configure();
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(driver_->try_write(0x55));
  driver_->drop_unsent();
  engine().advance_to(Time{100'000});
  EXPECT_EQ(sent_.size(), 1U);  // it had begun
  ASSERT_TRUE(driver_->try_write(0xAA));
  engine().advance_to(Time{200'000});
  EXPECT_EQ(sent_.back().byte, 0xAA);
}

TEST_F(Pl011Test, TellsFramingErrorsAndBreaks) {
  make_and_configure();
  arrive(0x55, Time{0}, false);
  arrive(0x00, Time{4'000}, false);
  arrive(0xA5, Time{8'000});
  engine().advance_to(Time{20'000});
  for (const auto& [byte, fault] :
       {std::pair{std::uint8_t{0x55}, Errc::framing_error},
        std::pair{std::uint8_t{0x00}, Errc::framing_error}, std::pair{std::uint8_t{0xA5}, Errc::ok}}) {
    const mcu::ReceivedCharacter character = driver_->try_read();
    EXPECT_TRUE(character.present);
    EXPECT_EQ(character.byte, byte);
    EXPECT_EQ(character.fault, fault);
  }
  EXPECT_FALSE(driver_->try_read().present);
}

TEST_F(Pl011Test, AnOverrunIsToldOnceAndDoesNotReachTheNextReply) {
  make_and_configure({.depth = 16});
  for (int i = 0; i < 20; ++i) arrive(static_cast<std::uint8_t>(i), Time{4'000 * i});
  engine().advance_to(Time{100'000});
  for (int i = 0; i < 16; ++i) EXPECT_EQ(driver_->try_read().byte, i);
  EXPECT_FALSE(driver_->try_read().present);
  EXPECT_TRUE(driver_->take_overrun());
  EXPECT_FALSE(driver_->take_overrun());
  arrive(0x77, Time{100'000});
  engine().advance_to(Time{110'000});
  const mcu::ReceivedCharacter next = driver_->try_read();
  EXPECT_EQ(next.byte, 0x77);
  EXPECT_EQ(next.fault, Errc::ok);
}

TEST_F(Pl011Test, NobodyThereIsPortGone) {
  make({.present = false});
  EXPECT_EQ(driver_->configure(kDivisor), std::unexpected(Errc::port_gone));
  make({.clocked = false});
  EXPECT_EQ(driver_->configure(kDivisor), std::unexpected(Errc::port_gone));
  make_and_configure();
  model_->vanish();
  EXPECT_EQ(driver_->try_read().fault, Errc::port_gone);
  EXPECT_FALSE(driver_->transmitter_idle());
}

}  // namespace
}  // namespace tm485::test
