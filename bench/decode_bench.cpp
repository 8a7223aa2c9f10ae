// Encode and decode of every ID, and the floor that decoding is held against.
//
// BM_DecodeId3 and BM_FloorXorFold run over the same frames, through the same kind of call that is
// not inlined, and their results stay in memory for whoever wants them. The floor does the least work
// that yields the fields; it checks the XOR and the CF and nothing else. BM_DecodeId3 makes every
// check and keeps the fields packed; BM_DecodeId3AllFields also takes all five of them out again.
#include <benchmark/benchmark.h>

#include <cstdint>
#include <cstring>
#include <expected>
#include <span>

#include "frames.hpp"
#include "tm485/protocol/frame.hpp"
#include "tm485/protocol/profile.hpp"
#include "tm485/protocol/request.hpp"

namespace tm485::bench {
namespace {

/// Made at run time and passed by reference, so that the compiler cannot fold its masks into the code.
CompiledProfile make_profile() {
  Profile profile;
  benchmark::DoNotOptimize(profile);
  return *CompiledProfile::compile(profile);
}

struct FloorFields {
  std::uint32_t abs;
  std::uint32_t abm;
  std::uint8_t sf;
  std::uint8_t enid;
  std::uint8_t almc;
};
static_assert(sizeof(FloorFields) <= 16);

[[gnu::noinline]] bool floor_xor_fold(std::span<const std::uint8_t> bytes, FloorFields& fields) noexcept {
  std::uint64_t low = 0;
  std::uint64_t high = 0;
  std::memcpy(&low, bytes.data(), 8);
  std::memcpy(&high, bytes.data() + 3, 8);
  high >>= 40;
  std::uint64_t sum = low ^ high;
  sum ^= sum >> 32;
  sum ^= sum >> 16;
  sum ^= sum >> 8;
  fields.sf = static_cast<std::uint8_t>(low >> 8);
  fields.abs = static_cast<std::uint32_t>(low >> 16) & 0xFFFFFFU;
  fields.enid = static_cast<std::uint8_t>(low >> 40);
  fields.abm = static_cast<std::uint32_t>(low >> 48 | (high & 0xFF) << 16);
  fields.almc = static_cast<std::uint8_t>(high >> 8);
  return (sum & 0xFF) == 0 && (low & 0xFF) == 0x1A;
}

[[gnu::noinline]] std::expected<Reply, Errc> decode(std::span<const std::uint8_t> bytes, DataId id,
                                                    const CompiledProfile& profile) noexcept {
  return Reply::parse(bytes, id, profile);
}

[[gnu::noinline]] std::expected<Reply, Errc> decode_id3(std::span<const std::uint8_t> bytes,
                                                        const CompiledProfile& profile) noexcept {
  return Reply::parse(bytes, DataId::everything, profile);
}

void BM_FloorXorFold(benchmark::State& state) {
  const Frames frames(DataId::everything);
  std::size_t i = 0;
  for (auto _ : state) {
    FloorFields fields;
    if (!floor_xor_fold(frames[i++], fields)) {
      state.SkipWithError("a valid frame was refused");
      break;
    }
    benchmark::DoNotOptimize(fields);
  }
}
BENCHMARK(BM_FloorXorFold);

void BM_DecodeId3(benchmark::State& state) {
  const CompiledProfile profile = make_profile();
  const Frames frames(DataId::everything);
  std::size_t i = 0;
  for (auto _ : state) {
    auto reply = decode_id3(frames[i++], profile);
    if (!reply) {
      state.SkipWithError("a valid frame was refused");
      break;
    }
    benchmark::DoNotOptimize(reply);
  }
}
BENCHMARK(BM_DecodeId3);

void BM_DecodeId3AllFields(benchmark::State& state) {
  const CompiledProfile profile = make_profile();
  const Frames frames(DataId::everything);
  std::size_t i = 0;
  std::uint32_t sum = 0;
  for (auto _ : state) {
    const auto reply = decode_id3(frames[i++], profile);
    if (!reply) {
      state.SkipWithError("a valid frame was refused");
      break;
    }
    const Frame& frame = reply->frame();
    sum += frame.abs() ^ frame.abm() ^ frame.sf() ^ frame.enid() ^ frame.almc();
  }
  benchmark::DoNotOptimize(sum);
}
BENCHMARK(BM_DecodeId3AllFields);

void BM_Decode(benchmark::State& state) {
  const auto id = static_cast<DataId>(state.range(0));
  const CompiledProfile profile = make_profile();
  const Frames frames(id);
  std::size_t i = 0;
  for (auto _ : state) {
    auto reply = decode(frames[i++], id, profile);
    if (!reply) {
      state.SkipWithError("a valid frame was refused");
      break;
    }
    benchmark::DoNotOptimize(reply);
  }
}
BENCHMARK(BM_Decode)->ArgName("id")->Arg(0)->Arg(1)->Arg(2)->Arg(3)->Arg(6)->Arg(7)->Arg(8)->Arg(12)->Arg(13);

[[gnu::noinline]] std::expected<Request, Errc> encode(DataId id, unsigned address,
                                                      std::uint8_t data) noexcept {
  if (id == DataId::eeprom_read) return Request::eeprom_read(address);
  if (id == DataId::eeprom_write) return Request::eeprom_write(address, data);
  return Request::make(id);
}

void BM_Encode(benchmark::State& state) {
  const auto id = static_cast<DataId>(state.range(0));
  unsigned address = 0;
  for (auto _ : state) {
    auto request = encode(id, address++ & 0x7FU, 0xA5);
    benchmark::DoNotOptimize(request);
  }
}
BENCHMARK(BM_Encode)->ArgName("id")->Arg(0)->Arg(1)->Arg(2)->Arg(3)->Arg(6)->Arg(7)->Arg(8)->Arg(12)->Arg(13);

}  // namespace
}  // namespace tm485::bench
