// Frame::parse against the slow decoder: same verdict, same fields, whatever the bytes.
#include <vector>

#include "fuzz/input.hpp"
#include "fuzz/targets.hpp"
#include "support/frames.hpp"
#include "support/slow_decoder.hpp"
#include "tm485/protocol/frame.hpp"

namespace tm485::fuzz {
namespace {

constexpr test::SlowProfile kAny{"any", 24, false, 0, {}};

/// The lowest `bits` as a number with a sign, by adding weights.
std::int64_t with_sign(std::uint32_t value, unsigned bits) {
  std::int64_t sum = 0;
  for (unsigned bit = 0; bit < bits; ++bit) {
    const std::int64_t weight = std::int64_t{1} << bit;
    if ((value >> bit) % 2 != 0) sum += bit + 1 == bits ? -weight : weight;
  }
  return sum;
}

void compare(const std::expected<Frame, Errc>& frame, const test::SlowReply& slow, unsigned turn_bits) {
  require((frame ? name(Errc::ok) : name(frame.error())) == slow.error, "verdict");
  if (!frame) return;
  require(number(frame->id()) == slow.id, "ID");
  for (const char letter : test::shape_of(slow.id)) {
    if (letter == 's') require(frame->sf() == slow.sf, "SF");
    if (letter == 'a') require(frame->abs() == slow.abs, "ABS");
    if (letter == 'e') require(frame->enid() == slow.enid, "ENID");
    if (letter == 'd') require(frame->adf() == slow.adf, "ADF");
    if (letter == 'd') require(frame->address() == slow.adf % 128, "address");
    if (letter == 'd') require(frame->eeprom_busy() == (slow.adf >= 128), "busy");
    if (letter == 'D') require(frame->edf() == slow.edf, "EDF");
    if (letter == 'm') require(frame->abm() == slow.abm, "ABM");
    if (letter == 'm') require(frame->turns(turn_bits) == with_sign(slow.abm, turn_bits), "turns");
  }
  require(frame->almc() == slow.almc, "ALMC");
}

}  // namespace

/// asked, turn bits and whether the CRC is put right, then the frame.
int fuzz_frame(std::span<const std::uint8_t> bytes) {
  Input input(bytes);
  const test::Kind& asked = test::kKinds[input.below(9)];
  const unsigned turn_bits = 8 + input.below(17);
  const bool seal = input.flag();
  std::vector<std::uint8_t> frame(input.rest().begin(), input.rest().end());
  if (seal && !frame.empty()) {
    frame.pop_back();
    frame = test::sealed(frame);
  }
  compare(Frame::parse(frame, static_cast<DataId>(asked.id)), test::slow_parse(frame, asked.id, kAny),
          turn_bits);
  if (frame.empty()) {
    require(Frame::parse(frame).error() == Errc::length_error, "no frame is empty");
    return 0;
  }
  const test::CfVerdict cf = test::classify_cf(frame[0]);
  const test::SlowReply alone =
      cf.error == "ok" ? test::slow_parse(frame, cf.id, kAny) : test::SlowReply{cf.error};
  compare(Frame::parse(frame), alone, turn_bits);
  return 0;
}

}  // namespace tm485::fuzz
