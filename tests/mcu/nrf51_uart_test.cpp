// The register driver of the nRF51's UART on its model. The port's contract is judged in tests/conformance.
#include "tm485/mcu/nrf51_uart.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "mcu/model_access.hpp"
#include "mcu/models/nrf51_model.hpp"

namespace tm485::test {
namespace {

using Driver = mcu::Nrf51Uart<ModelAccess<Nrf51Model>>;

constexpr auto kMegabit = *Driver::divisor_for(1'000'000);
static_assert(kMegabit.divisor == 0x10000000 && kMegabit.character_time == Time{10'000});

/// Ten bits of an encoder that sends at the UART's rate.
void arrive(Nrf51Model& model, std::uint8_t byte, Time start, bool stop_bit = true) {
  model.engine().arrive({byte, start, start + Time{10'000}, stop_bit});
}

TEST(Nrf51Uart, CannotMakeTheRateOfAnEncoder) {
  const auto refused = Driver::divisor_for(2'500'000);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::bad_argument);
  EXPECT_EQ(refused.error().nearest, 1'000'000U);
}

TEST(Nrf51Uart, IsRefusedWhereThereIsNone) {
  Nrf51Model model({.keeps = false});
  EXPECT_EQ(Driver(ModelAccess(model)).configure(kMegabit), std::unexpected(Errc::port_gone));
  Nrf51Model gone({.present = false});
  EXPECT_EQ(Driver(ModelAccess(gone)).configure(kMegabit), std::unexpected(Errc::port_gone));
}

TEST(Nrf51Uart, SendsOneByteAfterTheOther) {
  Nrf51Model model;
  std::vector<LineCharacter> sent;
  model.engine().on_sent = [&](const LineCharacter& character) { sent.push_back(character); };
  Driver driver(ModelAccess<Nrf51Model>{model});
  ASSERT_TRUE(driver.configure(kMegabit));
  EXPECT_TRUE(driver.transmitter_idle());
  EXPECT_TRUE(driver.try_write(0xEA));
  EXPECT_FALSE(driver.try_write(0x05));
  EXPECT_FALSE(driver.transmitter_idle());
  model.engine().advance_to(Time{9'999});
  EXPECT_FALSE(driver.try_write(0x05));
  model.engine().advance_to(Time{10'000});
  EXPECT_TRUE(driver.try_write(0x05));
  model.engine().advance_to(Time{30'000});
  EXPECT_TRUE(driver.transmitter_idle());
  ASSERT_EQ(sent.size(), 2U);
  EXPECT_EQ(sent[0].end - sent[0].start, Time{10'000});
  EXPECT_EQ(sent[1].byte, 0x05);
  EXPECT_EQ(model.engine().complaints(), std::vector<std::string>{});
}

TEST(Nrf51Uart, KeepsSixCharactersInOrderAndTellsAnOverrunOnce) {
  Nrf51Model model;
  Driver driver(ModelAccess<Nrf51Model>{model});
  ASSERT_TRUE(driver.configure(kMegabit));
  for (std::uint8_t i = 0; i < 8; ++i) arrive(model, i, Time{10'000 * i});
  model.engine().advance_to(Time{200'000});
  for (std::uint8_t i = 0; i < 6; ++i) {
    const mcu::ReceivedCharacter character = driver.try_read();
    EXPECT_TRUE(character.present);
    EXPECT_EQ(character.byte, i);
    EXPECT_EQ(character.fault, Errc::ok);
  }
  EXPECT_FALSE(driver.try_read().present);
  EXPECT_TRUE(driver.take_overrun());
  EXPECT_FALSE(driver.try_read().present);
  EXPECT_FALSE(driver.take_overrun());
  EXPECT_EQ(model.engine().complaints(), std::vector<std::string>{});
}

TEST(Nrf51Uart, TellsAMissingStopBitWithItsCharacterAndForgetsIt) {
  Nrf51Model model;
  Driver driver(ModelAccess<Nrf51Model>{model});
  ASSERT_TRUE(driver.configure(kMegabit));
  arrive(model, 0x1A, Time{0}, false);
  arrive(model, 0x33, Time{20'000});
  model.engine().advance_to(Time{15'000});
  EXPECT_EQ(driver.try_read().fault, Errc::framing_error);
  model.engine().advance_to(Time{40'000});
  const mcu::ReceivedCharacter next = driver.try_read();
  EXPECT_EQ(next.fault, Errc::ok);
  EXPECT_EQ(next.byte, 0x33);
  EXPECT_EQ(model.engine().complaints(), std::vector<std::string>{});
}

}  // namespace
}  // namespace tm485::test
