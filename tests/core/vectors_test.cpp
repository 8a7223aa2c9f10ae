// The golden vectors, every one, by its kind and direction.
#include <gtest/gtest.h>

#include <map>
#include <set>

#include "support/print.hpp"
#include "support/profiles.hpp"
#include "support/vectors.hpp"
#include "tm485/protocol/frame.hpp"
#include "tm485/protocol/request.hpp"

namespace tm485 {
namespace {

using test::error_of;
using test::Vector;

void expect_request(const Vector& vector) {
  const auto request = Request::parse(vector.bytes);
  ASSERT_TRUE(request) << vector.id << ": " << name(request.error());
  EXPECT_EQ(test::Bytes(request->bytes().begin(), request->bytes().end()), vector.bytes) << vector.id;
  EXPECT_EQ(vector.field("cf").value_or(vector.bytes[0]), vector.bytes[0]) << vector.id;
  for (const char* key : {"adf", "address", "adr"})
    EXPECT_EQ(vector.field(key).value_or(request->address()), request->address()) << vector.id;
  EXPECT_EQ(vector.field("edf").value_or(request->data()), request->data()) << vector.id;
}

void expect_fields(const Vector& vector, const Frame& frame) {
  std::set<std::string> known{"crc"};
  const auto check = [&](const char* key, std::uint32_t seen) {
    known.insert(key);
    EXPECT_EQ(vector.field(key).value_or(seen), seen) << vector.id << " " << key;
  };
  check("cf", frame.cf());
  check("sf", frame.sf());
  check("abs", frame.abs());
  check("abm", frame.abm());
  check("enid", frame.enid());
  check("almc", frame.almc());
  check("adf", frame.adf());
  check("address", frame.address());
  check("adr", frame.address());
  check("busy", frame.eeprom_busy() ? 1U : 0U);
  check("edf", frame.edf());
  known.insert("abm_signed16");
  if (vector.decoded.contains("abm_signed16")) {
    EXPECT_EQ(vector.decoded.at("abm_signed16").get<int>(), frame.turns(16)) << vector.id;
  }
  for (const auto& [key, value] : vector.decoded.items())
    EXPECT_TRUE(known.contains(key)) << vector.id << ": nobody looked at " << key;
  EXPECT_EQ(frame.crc(), vector.bytes.back()) << vector.id;
}

TEST(Vectors, Tm485) {
  const auto vectors = test::load_vectors("vectors_tm485.json");
  std::map<std::string, int> kinds;
  const CompiledProfile of_17 = test::compiled("tm485_17");
  const CompiledProfile of_23 = test::compiled("tm485_23");
  const CompiledProfile of_17_st = test::compiled("tm485_17_st");
  for (const Vector& vector : vectors) {
    SCOPED_TRACE(vector.id);
    ++kinds[vector.kind];
    const bool to_encoder = vector.direction == "host->encoder";
    ASSERT_TRUE(to_encoder || vector.direction == "encoder->host");
    if (vector.kind == "negative" || vector.kind == "erratum") {
      const Errc error =
          to_encoder ? error_of(Request::parse(vector.bytes)) : error_of(Frame::parse(vector.bytes));
      EXPECT_EQ(name(error), vector.decoded.at("expect").get<std::string>());
      continue;
    }
    if (vector.kind ==
        "document") {  // the printed CFs: of every ID, those of EEPROM requests with more bytes to follow
      ASSERT_EQ(vector.bytes.size(), 1U);
      const auto id = parse_control_field(vector.bytes[0]);
      ASSERT_TRUE(id);
      EXPECT_EQ(number(*id), vector.decoded.at("data_id").get<unsigned>());
      EXPECT_EQ(vector.bytes[0] >> 7, vector.decoded.at("parity_bit").get<int>());
      EXPECT_EQ(control_field(*id), vector.bytes[0]);
      if (layout(*id).request_length == 1) expect_request(vector);
      continue;
    }
    if (to_encoder) {
      expect_request(vector);
      continue;
    }
    const auto frame = Frame::parse(vector.bytes);
    ASSERT_TRUE(frame) << name(frame.error());
    expect_fields(vector, *frame);
    const auto& profile = vector.id == "tm485-id2-reply-17st"   ? of_17_st
                          : vector.id == "tm485-id2-reply-23mt" ? of_23
                                                                : of_17;
    EXPECT_EQ(error_of(Reply::parse(vector.bytes, frame->id(), profile)), Errc::ok);
  }
  EXPECT_EQ(vectors.size(), 32U);
  EXPECT_EQ(kinds, (std::map<std::string, int>{
                       {"document", 9}, {"derived", 10}, {"derived_from_public", 9}, {"negative", 4}}));
}

TEST(Vectors, TFormat) {
  const auto vectors = test::load_vectors("vectors_tformat.json");
  std::map<std::string, int> kinds;
  const CompiledProfile of_23 = test::compiled("tformat_23");
  for (const Vector& vector : vectors) {
    SCOPED_TRACE(vector.id);
    ++kinds[vector.kind];
    const auto id = parse_control_field(vector.bytes.at(0));
    ASSERT_TRUE(id);
    const bool eeprom = *id == DataId::eeprom_read || *id == DataId::eeprom_write;
    if (vector.decoded.contains("direction")) {
      Vector request = vector;
      request.decoded.erase("direction");
      expect_request(request);
      continue;
    }
    const auto frame = Frame::parse(vector.bytes);
    ASSERT_TRUE(frame) << name(frame.error());
    expect_fields(vector, *frame);
    const auto reply = Reply::parse(vector.bytes, *id, of_23);
    if (vector.kind.starts_with("captured") || eeprom) {
      EXPECT_EQ(error_of(reply), Errc::ok);
    }
    // SF = 20 for ever, ALMC C1, C8 or C9: the normal state of a real encoder with no battery.
    if (vector.kind.starts_with("captured")) {
      EXPECT_EQ(frame->sf(), 0x20);
      EXPECT_EQ(of_23.profile().alarms.level(frame->status()), AlarmLevel::none);
    }
  }
  EXPECT_EQ(vectors.size(), 38U);
  EXPECT_EQ(kinds["captured"], 7);
  EXPECT_EQ(kinds["captured-reconstructed"], 19);
}

}  // namespace
}  // namespace tm485
