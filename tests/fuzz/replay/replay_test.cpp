// Each target with the files of its corpus, with no byte at all, and with each of those files cut and changed a little:
// what the fuzzers have found stays found, with every compiler.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "fuzz/targets.hpp"

namespace tm485::fuzz {
namespace {

struct Target {
  const char* name;
  int (*run)(std::span<const std::uint8_t>);
};

constexpr Target kTargets[] = {
    {"frame", fuzz_frame},
    {"reply", fuzz_reply},
    {"request", fuzz_request},
    {"exchange", fuzz_exchange},
    {"bus", fuzz_bus},
    {"c", fuzz_c},
    {"sim_options", fuzz_sim_options},
    {"plan", fuzz_plan},
#ifdef TM485_FUZZ_TOOLS
    {"image", fuzz_image},
    {"journal", fuzz_journal},
    {"profile", fuzz_profile},
    {"quantities", fuzz_quantities},
    {"arguments", fuzz_arguments},
#endif
};

void PrintTo(const Target& target, std::ostream* out) { *out << target.name; }

class Replay : public testing::TestWithParam<Target> {};

std::vector<std::uint8_t> content_of(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

TEST_P(Replay, Corpus) {
  const std::filesystem::path folder = std::filesystem::path(TM485_FUZZ_CORPUS) / GetParam().name;
  std::size_t files = 0;
  EXPECT_EQ(GetParam().run({}), 0);
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    std::vector<std::uint8_t> bytes = content_of(entry.path());
    // An input that ends the process is the last one that is named.
    std::printf("%s/%s: %zu bytes\n", GetParam().name, entry.path().filename().c_str(), bytes.size());
    std::fflush(stdout);
    EXPECT_EQ(GetParam().run(bytes), 0);
    ++files;
    std::mt19937 random(1);
    for (int round = 0; round < 16 && !bytes.empty(); ++round) {
      bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random());
      if (round % 4 == 3) bytes.resize(random() % bytes.size() + 1);
      EXPECT_EQ(GetParam().run(bytes), 0);
    }
  }
  EXPECT_GT(files, 0U) << "no corpus in " << folder;
}

INSTANTIATE_TEST_SUITE_P(Fuzz, Replay, testing::ValuesIn(kTargets),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace tm485::fuzz
