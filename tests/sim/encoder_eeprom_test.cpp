// The EEPROM: pages, busy times, endurance, what a power loss leaves.
#include <gtest/gtest.h>

#include <set>

#include "ask.hpp"

namespace tm485::sim {
namespace {

constexpr int kPageRegister = 127;
const Bytes kWrite = write_request(0x05, 0xA5);
const Bytes kRead = read_request(0x05);
const Bytes kSelectThree = write_request(kPageRegister, 3);

/// ADF and EDF of the reply; nothing if there is none.
Bytes fields(EncoderModel& encoder, Time start, const Bytes& request) {
  const Bytes reply = ask(encoder, start, request);
  return reply.empty() ? reply : Bytes{reply.at(1), reply.at(2)};
}

TEST(EepromPages, AreSeparateAndTheRegisterReadsBack) {
  EncoderModel encoder;
  ask(encoder, ms(0), kWrite);
  ask(encoder, ms(20), kSelectThree);
  EXPECT_EQ(fields(encoder, ms(40), kRead), (Bytes{0x05, 0xFF}));
  EXPECT_EQ(fields(encoder, ms(41), read_request(kPageRegister)), (Bytes{0x7F, 0x03}));
  ask(encoder, ms(60), write_request(kPageRegister, 0));
  EXPECT_EQ(fields(encoder, ms(80), kRead), (Bytes{0x05, 0xA5}));
}

TEST(EepromPages, HaveATotalOf889BytesThatLieOneAfterTheOther) {
  EepromModel eeprom;
  EXPECT_EQ(eeprom.image().size(), 889u);
  for (int page = 0; page < 7; ++page) {
    eeprom.write(127, static_cast<std::uint8_t>(page), ms(100) * page);
    eeprom.write(126, static_cast<std::uint8_t>(page), ms(100) * page + ms(50));
    EXPECT_EQ(eeprom.image()[static_cast<std::size_t>(page) * 127 + 126], page);
  }
}

TEST(EepromPages, APowerCycleKeepsTheBytesAndSelectsPageZero) {
  EncoderModel encoder;
  ask(encoder, ms(0), kSelectThree);
  ask(encoder, ms(20), kWrite);
  encoder.power_off(ms(40));
  encoder.power_on(ms(41));
  EXPECT_EQ(fields(encoder, ms(50), read_request(kPageRegister)), (Bytes{0x7F, 0x00}));
  ask(encoder, ms(60), kSelectThree);
  EXPECT_EQ(fields(encoder, ms(80), kRead), (Bytes{0x05, 0xA5}));
}

TEST(EepromPages, ThePageAfterPowerUpCanBeSetAndCanSurvive) {
  for (const bool is_volatile : {true, false}) {
    EncoderModel encoder{{.eeprom = {.page_volatile = is_volatile, .power_up_page = 2}}};
    EXPECT_EQ(encoder.eeprom().read(127), 2);
    ask(encoder, ms(0), kSelectThree);
    encoder.power_off(ms(40));
    encoder.power_on(ms(41));
    EXPECT_EQ(fields(encoder, ms(50), read_request(kPageRegister))[1], is_volatile ? 2 : 3);
  }
}

TEST(EepromPages, ARegisterThatSurvivesAndIsChangedAtAPowerLossHasEitherValue) {
  std::set<int> pages;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    EncoderModel encoder{{.eeprom = {.page_volatile = false, .seed = seed}}};
    ask(encoder, ms(0), kSelectThree);
    encoder.power_off(ms(17));
    encoder.power_on(ms(41));
    pages.insert(fields(encoder, ms(50), read_request(kPageRegister))[1]);
  }
  EXPECT_EQ(pages, (std::set{0, 3}));
}

TEST(EepromBusy, AReadAfterAWriteIsVoidForTenMilliseconds) {
  EncoderModel encoder;
  ask(encoder, ms(0), kWrite);
  EXPECT_EQ(ask(encoder, ms(10) - Time{1}, kRead), (Bytes{0xEA, 0x85, 0x00, 0x6F}));  // tm485-eerd-rsp-busy
  EXPECT_EQ(ask(encoder, ms(11), kRead), (Bytes{0xEA, 0x05, 0xA5, 0x4A}));
  EXPECT_EQ(encoder.statistics().busy_reads, 1u);
}

TEST(EepromBusy, AtItsLastInstantItIsOver) {
  EncoderModel encoder;
  ask(encoder, ms(0), kWrite);
  EXPECT_EQ(fields(encoder, ms(10), kRead), (Bytes{0x05, 0xA5}));
}

TEST(EepromBusy, AWriteThatComesMeanwhileIsNotStored) {
  EncoderModel encoder;
  ask(encoder, ms(0), kWrite);
  EXPECT_EQ(fields(encoder, ms(5), write_request(0x06, 0x11)), (Bytes{0x86, 0x00}));
  EXPECT_EQ(fields(encoder, ms(6), kSelectThree), (Bytes{0xFF, 0x00}));
  EXPECT_EQ(encoder.eeprom().read(0x06), 0xFF);
  EXPECT_EQ(encoder.eeprom().read(127), 0);
  EXPECT_EQ(fields(encoder, ms(10), kRead), (Bytes{0x05, 0xA5}));  // and does not prolong it
  EXPECT_EQ(encoder.statistics().busy_writes, 2u);
  EXPECT_EQ(encoder.eeprom().writes(), 1u);
  EXPECT_EQ(encoder.eeprom().page_selects(), 0u);
}

TEST(EepromBusy, APageSelectTakesEighteenMilliseconds) {
  for (const bool over : {false, true}) {
    EncoderModel encoder;
    EXPECT_EQ(ask(encoder, ms(0), kSelectThree), kSelectThree);
    EXPECT_EQ(fields(encoder, ms(18) - Time{over ? 0 : 1}, read_request(kPageRegister)),
              over ? (Bytes{0x7F, 0x03}) : (Bytes{0xFF, 0x00}));
  }
}

TEST(EepromBusy, TheWriteTimeIsDrawnFromItsWholeRange) {
  Time shortest = kNever;
  Time longest{0};
  EepromModel eeprom{{.write_time_min = ms(5), .write_time_max = ms(12)}};
  for (int k = 0; k < 1000; ++k) {
    const Time start = ms(20) * k;
    ASSERT_TRUE(eeprom.write(0, 0, start));
    shortest = std::min(shortest, eeprom.busy_until() - start);
    longest = std::max(longest, eeprom.busy_until() - start);
  }
  EXPECT_GE(shortest, ms(5));
  EXPECT_LT(shortest, ms(5) + us(50));
  EXPECT_LE(longest, ms(12));
  EXPECT_GT(longest, ms(12) - us(50));
}

TEST(EepromBusy, Tm485EchoesPlainlyAndTFormatWithTheBusyBit) {
  for (const Flavour flavour : {Flavour::tm485, Flavour::t_format}) {
    EncoderModel encoder{{.flavour = flavour}};
    EXPECT_EQ(fields(encoder, ms(0), kWrite)[0], flavour == Flavour::tm485 ? 0x05 : 0x85);
    EncoderModel other{{.flavour = flavour, .eeprom = {.write_reply_busy = flavour == Flavour::tm485}}};
    EXPECT_EQ(fields(other, ms(0), kWrite)[0], flavour == Flavour::tm485 ? 0x85 : 0x05);
  }
}

TEST(EepromBusy, PositionsAreAnsweredMeanwhile) {
  EncoderModel encoder;
  ask(encoder, ms(0), kWrite);
  EXPECT_EQ(ask(encoder, ms(5), {0x1A}).size(), 11u);
}

TEST(EepromBusy, ADeafEncoderAnswersOnlyItsEepromRequests) {
  EncoderModel encoder{{.eeprom = {.deaf_while_busy = true}}};
  ask(encoder, ms(0), kWrite);
  EXPECT_TRUE(ask(encoder, ms(5), {0x1A}).empty());
  EXPECT_EQ(fields(encoder, ms(6), kRead), (Bytes{0x85, 0x00}));
  EXPECT_TRUE(ask(encoder, ms(6) + us(26), kRead).empty());  // into its own reply
  EXPECT_TRUE(ask(encoder, ms(7), {0x02}).empty());
  EXPECT_EQ(ask(encoder, ms(10), {0x1A}).size(), 11u);
  EXPECT_TRUE(ask(encoder, ms(10) + us(20), kRead).empty());  // into its own reply
  EXPECT_EQ(fields(encoder, ms(11), kRead), (Bytes{0x05, 0xA5}));
  EXPECT_EQ(encoder.statistics().busy_silences, 2u);
  EXPECT_EQ(encoder.statistics().deaf_requests, 2u);
}

TEST(EepromEndurance, WritesAreCountedForEachByteAndPageSelects) {
  EncoderModel encoder;
  ask(encoder, ms(0), kWrite);
  ask(encoder, ms(20), kWrite);  // the same value wears it out as well
  ask(encoder, ms(40), kSelectThree);
  ask(encoder, ms(60), kWrite);
  EXPECT_EQ(encoder.eeprom().writes(0, 5), 2u);
  EXPECT_EQ(encoder.eeprom().writes(3, 5), 1u);
  EXPECT_EQ(encoder.eeprom().writes(3, 6), 0u);
  EXPECT_EQ(encoder.eeprom().writes(), 3u);
  EXPECT_EQ(encoder.eeprom().page_selects(), 1u);
}

TEST(EepromPowerLoss, InTheMiddleOfAWriteMakesThatByteGarbageAndNoOther) {
  std::set<int> found;
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    EncoderModel encoder{{.boot_time = ms(5), .eeprom = {.seed = seed}}};
    EepromModel::Image before{};
    for (std::size_t k = 0; k < before.size(); ++k) before[k] = static_cast<std::uint8_t>(k * 7);
    ASSERT_TRUE(encoder.eeprom().set_image(before));
    ask(encoder, ms(5), kSelectThree);
    ask(encoder, ms(25), kWrite);
    encoder.power_off(ms(35) - Time{1});
    encoder.power_on(ms(40));
    EXPECT_TRUE(ask(encoder, ms(44), kRead).empty());
    ask(encoder, ms(45), kSelectThree);
    found.insert(fields(encoder, ms(70), kRead)[1]);
    EXPECT_EQ(encoder.eeprom().spoiled_bytes(), 1u);
    before[3 * 127 + 5] = encoder.eeprom().read(5);
    EXPECT_TRUE(std::ranges::equal(encoder.eeprom().image(), before));
  }
  EXPECT_GT(found.size(), 100u);
}

TEST(EepromPowerLoss, AfterAWriteHarmsNothing) {
  EncoderModel encoder;
  ask(encoder, ms(0), kWrite);
  encoder.power_off(ms(10));
  encoder.power_on(ms(20));
  EXPECT_EQ(fields(encoder, ms(30), kRead), (Bytes{0x05, 0xA5}));
}

TEST(EepromPowerLoss, BeforeTheRequestIsWholeHarmsNothing) {
  EncoderModel encoder;
  encoder.power_off(us(16));  // the request's last stop bit
  encoder.power_on(ms(1));
  EXPECT_TRUE(ask(encoder, us(0), kWrite).empty());
  EXPECT_EQ(fields(encoder, ms(2), kRead), (Bytes{0x05, 0xFF}));
}

TEST(EepromPowerLoss, CanBeSeenWithoutARequest) {
  EncoderModel encoder;
  ask(encoder, ms(0), kWrite);
  encoder.power_off(ms(5));
  encoder.advance_to(ms(6));
  EXPECT_EQ(encoder.eeprom().spoiled_bytes(), 1u);
}

TEST(EepromPowerLoss, AnEncoderThatIsBackIsNotBusy) {
  EncoderModel encoder;
  ask(encoder, ms(0), kSelectThree);
  encoder.power_off(ms(1));
  encoder.power_on(ms(2));
  EXPECT_EQ(fields(encoder, ms(3), kWrite), (Bytes{0x05, 0xA5}));
  EXPECT_EQ(encoder.eeprom().interval_violations(), 0u);
}

TEST(EepromImage, IsReplacedAsAWholeOrNotAtAll) {
  EepromModel eeprom{{.pages = 6}};
  Bytes image(762, 0x11);
  EXPECT_TRUE(eeprom.set_image(image));
  image.push_back(0x22);
  EXPECT_FALSE(eeprom.set_image(image));
  EXPECT_EQ(eeprom.image().size(), 762u);
  EXPECT_EQ(eeprom.image().back(), 0x11);
  EXPECT_EQ(eeprom.writes(), 0u);
}

TEST(EepromImage, TheSettledOneHasAWriteOnceItIsComplete) {
  EepromModel eeprom;
  const std::uint64_t before = eeprom.generation(ms(0));
  eeprom.write(5, 0x33, ms(0));
  EXPECT_EQ(eeprom.image()[5], 0x33);
  EXPECT_EQ(eeprom.settled_image(ms(9))[5], 0xFF);
  EXPECT_EQ(eeprom.generation(ms(9)), before);
  EXPECT_EQ(eeprom.settled_image(ms(10))[5], 0x33);
  EXPECT_EQ(eeprom.generation(ms(10)), before + 1);
  eeprom.write(6, 0x44, ms(10));
  EXPECT_EQ(eeprom.settled_image(ms(10))[5], 0x33);
  EXPECT_EQ(eeprom.settled_image(ms(10))[6], 0xFF);
  eeprom.on_power_off(ms(11));
  EXPECT_EQ(eeprom.settled_image(ms(11))[6], eeprom.image()[6]);
  EXPECT_EQ(eeprom.generation(ms(11)), before + 2);
}

TEST(EncoderEeprom, BusyFromTheStartUntilTheInstantThatWasAsked) {
  EncoderConfig config;
  config.eeprom.busy_at_start = ms(5);
  EncoderModel encoder{config};
  EXPECT_EQ(ask(encoder, ms(4), read_request(0)).at(1), 0x80);
  EXPECT_EQ(ask(encoder, ms(5), read_request(0)).at(1), 0x00);
}

}  // namespace
}  // namespace tm485::sim
