// The fuzz targets: each takes any bytes and answers 0, or ends the process. libFuzzer calls one of them without end
// (fuzzer_main.cpp); the unit tests call each with the files of its folder below corpus/ (replay/replay_test.cpp).
#pragma once

#include <cstdint>
#include <span>

namespace tm485::fuzz {

// The protocol, against a slow reference.
int fuzz_frame(std::span<const std::uint8_t> bytes);
int fuzz_reply(std::span<const std::uint8_t> bytes);
int fuzz_request(std::span<const std::uint8_t> bytes);

// Bytes and times as a script of what a port does.
int fuzz_exchange(std::span<const std::uint8_t> bytes);
int fuzz_bus(std::span<const std::uint8_t> bytes);
int fuzz_c(std::span<const std::uint8_t> bytes);

// Files and texts that people give to the tools.
int fuzz_sim_options(std::span<const std::uint8_t> bytes);
int fuzz_plan(std::span<const std::uint8_t> bytes);
int fuzz_image(std::span<const std::uint8_t> bytes);
int fuzz_journal(std::span<const std::uint8_t> bytes);
int fuzz_profile(std::span<const std::uint8_t> bytes);
int fuzz_quantities(std::span<const std::uint8_t> bytes);
int fuzz_arguments(std::span<const std::uint8_t> bytes);

}  // namespace tm485::fuzz
