// Request::parse and the factories against a table and byte loops of its own.
#include <algorithm>
#include <vector>

#include "fuzz/input.hpp"
#include "fuzz/targets.hpp"
#include "support/frames.hpp"
#include "support/slow_decoder.hpp"
#include "tm485/protocol/request.hpp"

namespace tm485::fuzz {
namespace {

std::string_view slow_verdict(std::span<const std::uint8_t> bytes) {
  if (bytes.empty()) return "length_error";
  const test::CfVerdict cf = test::classify_cf(bytes[0]);
  if (cf.error != "ok") return cf.error;
  const std::size_t length = cf.id == 6 ? 4 : cf.id == 13 ? 3 : 1;
  if (bytes.size() != length) return "length_error";
  if (length == 1) return "ok";
  for (int column = 0; column < 8; ++column) {
    int ones = 0;
    for (const std::uint8_t byte : bytes) ones += (byte >> column) & 1;
    if (ones % 2 != 0) return "crc_error";
  }
  return bytes[1] > 127 ? "bad_argument" : "ok";
}

}  // namespace

/// An address and data for the factories, whether the CRC is put right, then the bytes.
int fuzz_request(std::span<const std::uint8_t> bytes) {
  Input input(bytes);
  const unsigned address = input.u16();
  const std::uint8_t data = input.u8();
  const auto seal = input.flag();
  std::vector<std::uint8_t> wire(input.rest().begin(), input.rest().end());
  if (seal && wire.size() > 1) {
    wire.pop_back();
    wire = test::sealed(wire);
  }
  const auto parsed = Request::parse(wire);
  require((parsed ? name(Errc::ok) : name(parsed.error())) == slow_verdict(wire), "verdict");
  if (parsed) {
    require(std::ranges::equal(parsed->bytes(), wire), "the bytes are those of the line");
    require(parsed->address() == (wire.size() > 1 ? wire[1] : 0), "address");
    require(parsed->data() == (wire.size() == 4 ? wire[2] : 0), "data");
  }
  for (const auto& made : {Request::eeprom_read(address), Request::eeprom_write(address, data)}) {
    require(made.has_value() == (address < 128), "addresses are 0 to 127");
    if (!made) continue;
    require(slow_verdict(made->bytes()) == "ok", "what is made is well formed");
    require(made->address() == address, "address");
  }
  for (const test::Kind& kind : test::kKinds) {
    const auto made = Request::make(static_cast<DataId>(kind.id));
    require(made.has_value() == (kind.out == 1), "CF alone");
    if (made) require(made->bytes().size() == 1 && made->bytes()[0] == kind.cf, "CF");
  }
  return 0;
}

}  // namespace tm485::fuzz
