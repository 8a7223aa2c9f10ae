// Requests: exact bytes, refused arguments, and the way back.
#include "tm485/protocol/request.hpp"

#include <gtest/gtest.h>

#include "support/bit_serial.hpp"
#include "support/frames.hpp"
#include "support/print.hpp"

namespace tm485 {
namespace {

using test::Bytes;
using test::error_of;
using test::kKinds;

Bytes bytes_of(const Request& request) { return {request.bytes().begin(), request.bytes().end()}; }

TEST(Request, OfOneByteIsItsCf) {
  for (const auto& kind : kKinds) {
    const auto request = Request::make(static_cast<DataId>(kind.id));
    if (kind.out != 1) {
      EXPECT_EQ(error_of(request), Errc::bad_argument) << kind.id;
      continue;
    }
    ASSERT_TRUE(request) << kind.id;
    EXPECT_EQ(bytes_of(*request), Bytes{kind.cf});
    EXPECT_EQ(number(request->id()), kind.id);
    EXPECT_EQ(request->address(), 0);
    EXPECT_EQ(request->data(), 0);
  }
}

TEST(Request, EepromReadOfEveryAddress) {
  for (unsigned address = 0; address < 128; ++address) {
    const auto request = Request::eeprom_read(address);
    ASSERT_TRUE(request);
    const auto adf = static_cast<std::uint8_t>(address);
    EXPECT_EQ(bytes_of(*request), (Bytes{0xEA, adf, static_cast<std::uint8_t>(0xEA ^ address)}));
    EXPECT_EQ(request->id(), DataId::eeprom_read);
    EXPECT_EQ(request->address(), adf);
    EXPECT_EQ(request->data(), 0) << "a read carries no data, and certainly not its CRC";
  }
}

TEST(Request, EepromWriteOfEveryAddressAndByte) {
  for (unsigned address = 0; address < 128; ++address) {
    for (unsigned data = 0; data < 256; ++data) {
      const auto request = Request::eeprom_write(address, static_cast<std::uint8_t>(data));
      ASSERT_TRUE(request);
      const Bytes expected{0x32, static_cast<std::uint8_t>(address), static_cast<std::uint8_t>(data),
                           static_cast<std::uint8_t>(0x32 ^ address ^ data)};
      ASSERT_EQ(bytes_of(*request), expected);
      ASSERT_EQ(request->address(), address);
      ASSERT_EQ(request->data(), data);
    }
  }
}

TEST(Request, RefusesAddressesBeyond127) {
  for (const unsigned address : {128U, 129U, 255U, 256U, 383U, 0xFFFFFFFFU}) {
    EXPECT_EQ(error_of(Request::eeprom_read(address)), Errc::bad_argument) << address;
    EXPECT_EQ(error_of(Request::eeprom_write(address, 0)), Errc::bad_argument) << address;
  }
}

TEST(Request, ParseGivesBackWhatWasMade) {
  std::vector<Request> all;
  for (const auto& kind : kKinds)
    if (kind.out == 1) all.push_back(*Request::make(static_cast<DataId>(kind.id)));
  for (unsigned address = 0; address < 128; ++address) {
    all.push_back(*Request::eeprom_read(address));
    for (unsigned data = 0; data < 256; ++data)
      all.push_back(*Request::eeprom_write(address, static_cast<std::uint8_t>(data)));
  }
  for (const Request& request : all) {
    const auto back = Request::parse(request.bytes());
    ASSERT_TRUE(back);
    ASSERT_EQ(back->id(), request.id());
    ASSERT_EQ(back->address(), request.address());
    ASSERT_EQ(back->data(), request.data());
    ASSERT_EQ(bytes_of(*back), bytes_of(request));
  }
}

TEST(Request, ParseNamesEachFault) {
  EXPECT_EQ(error_of(Request::parse(Bytes{})), Errc::length_error);
  EXPECT_EQ(error_of(Request::parse(Bytes{0x03})), Errc::cf_sync_error);
  EXPECT_EQ(error_of(Request::parse(Bytes{0x82})), Errc::cf_parity_error);
  EXPECT_EQ(error_of(Request::parse(Bytes{0xA2})), Errc::unknown_id);
  EXPECT_EQ(error_of(Request::parse(Bytes{0xEA, 0x05, 0xEE})), Errc::crc_error);
  EXPECT_EQ(error_of(Request::parse(Bytes{0x32, 0x05, 0xA5, 0x93})), Errc::crc_error);
  EXPECT_EQ(error_of(Request::parse(test::sealed({0xEA, 0x85}))), Errc::bad_argument)
      << "busy exists in replies only";
  EXPECT_EQ(error_of(Request::parse(test::sealed({0x32, 0x85, 0xA5}))), Errc::bad_argument);
}

TEST(Request, ParseRefusesEveryOtherLength) {
  for (const auto& kind : kKinds) {
    for (std::size_t length = 1; length <= 40; ++length) {
      if (length == kind.out) continue;
      Bytes bytes(length, 0);
      bytes[0] = kind.cf;
      if (length > 1) bytes[length - 1] = kind.cf;  // the CRC holds
      EXPECT_EQ(error_of(Request::parse(bytes)), Errc::length_error) << kind.id << " " << length;
    }
  }
}

TEST(Request, EverySingleBitErrorOfAnEepromRequestIsRefused) {
  for (const Request& request : {*Request::eeprom_read(0x25), *Request::eeprom_write(0x25, 0xA5)}) {
    for (std::size_t bit = 0; bit < request.bytes().size() * 8; ++bit) {
      Bytes hit = bytes_of(request);
      hit[bit / 8] ^= static_cast<std::uint8_t>(1 << (bit % 8));
      EXPECT_FALSE(Request::parse(hit)) << bit;
    }
  }
}

// No request can be made but by the factories, and all of it works at compile time.
static_assert(!std::is_default_constructible_v<Request>);
static_assert(!std::is_constructible_v<Request, DataId>);
static_assert(!std::is_convertible_v<DataId, Request>);
static_assert(Request::make(DataId::everything)->bytes()[0] == 0x1A);
static_assert(Request::eeprom_write(127, 3)->bytes()[3] == 0x4E);
static_assert(!Request::make(DataId::eeprom_read));

}  // namespace
}  // namespace tm485
