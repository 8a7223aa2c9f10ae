// tm485 bench: its histograms in JSON and as a picture.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "cli/process.hpp"
#include "plot.hpp"
#include "time_buckets.hpp"

namespace tm485::test {
namespace {

using Json = nlohmann::json;

std::string read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

const std::vector<std::string> kQuick{"bench", "sim:t2=2.9us..3.4us", "--virtual", "--seconds", "0.2"};

Finished bench(std::initializer_list<std::string> more) {
  std::vector<std::string> arguments = kQuick;
  arguments.insert(arguments.end(), more);
  return run(arguments);
}

TEST(Bench, EveryHistogramCountsEveryValue) {
  const Json json = Json::parse(bench({"--json"}).out);
  for (const char* series : {"period", "lateness", "t2", "round_trip"}) {
    const Json& histogram = json.at(series).at("histogram");
    const auto& count = histogram.at("count");
    ASSERT_EQ(histogram.at("first_ns").size(), count.size());
    ASSERT_EQ(histogram.at("last_ns").size(), count.size());
    std::uint64_t sum = 0;
    for (std::size_t k = 0; k < count.size(); ++k) {
      sum += count[k].get<std::uint64_t>();
      EXPECT_GT(count[k].get<std::uint64_t>(), 0u);
      EXPECT_LE(histogram.at("first_ns")[k].get<std::int64_t>(),
                histogram.at("last_ns")[k].get<std::int64_t>());
    }
    EXPECT_EQ(sum, json.at(series).at("samples").get<std::uint64_t>()) << series;
    EXPECT_LE(histogram.at("first_ns").front().get<std::int64_t>(),
              json.at(series).at("min_ns").get<std::int64_t>());
    EXPECT_GE(histogram.at("last_ns").back().get<std::int64_t>(),
              json.at(series).at("max_ns").get<std::int64_t>());
  }
}

TEST(Bench, DrawsAPngAndAnSvg) {
  const TemporaryFolder folder;
  const std::string png = folder.write("bench.png", "an old picture");
  const std::string svg = folder.path("bench.svg");
  EXPECT_EQ(bench({"--plot", png, "--yes"}).exit_code, 0);
  EXPECT_EQ(bench({"--plot", svg}).exit_code, 0);
  const std::string pixels = read_file(png);
  EXPECT_EQ(pixels.substr(0, 8), "\x89PNG\r\n\x1a\n");
  EXPECT_EQ(pixels.substr(pixels.size() - 8, 4), "IEND");
  const std::string text = read_file(svg);
  EXPECT_NE(text.find("<svg"), std::string::npos);
  EXPECT_NE(text.find("</svg>"), std::string::npos);
}

TEST(Bench, AnOldPictureIsNotReplacedWithoutAsking) {
  const TemporaryFolder folder;
  const std::string picture = folder.write("bench.png", "an old picture");
  const Finished finished = bench({"--plot", picture});
  EXPECT_EQ(finished.exit_code, 2);
  EXPECT_NE(finished.err.find("file_exists"), std::string::npos) << finished.err;
  EXPECT_EQ(finished.out, "") << "before the run";
  EXPECT_EQ(read_file(picture), "an old picture");
}

TEST(Bench, APictureThatCannotBeIsRefusedBeforeTheRun) {
  const TemporaryFolder folder;
  for (const std::string& file :
       {folder.path("bench.jpg"), folder.path("bench"), folder.path("nowhere/bench.png"), folder.path("")}) {
    const Finished finished = bench({"--plot", file});
    EXPECT_EQ(finished.exit_code, 2) << file;
    EXPECT_NE(finished.err.find("bad_plot"), std::string::npos) << finished.err;
    EXPECT_EQ(finished.out, "") << file;
  }
}

TEST(Bench, ALinkKeepsLeadingToThePictureAndADeviceIsNoPicture) {
  const TemporaryFolder folder;
  const std::string picture = folder.write("picture", "an old picture");
  const std::string link = folder.path("bench.svg");
  std::filesystem::create_symlink(picture, link);
  EXPECT_EQ(bench({"--plot", link, "--yes"}).exit_code, 0);
  EXPECT_TRUE(std::filesystem::is_symlink(link));
  EXPECT_NE(read_file(picture).find("</svg>"), std::string::npos);
  const std::string pipe = folder.path("pipe.svg");
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  const Finished finished = bench({"--plot", pipe});
  EXPECT_EQ(finished.exit_code, 2);
  EXPECT_NE(finished.err.find("bad_plot"), std::string::npos) << finished.err;
  EXPECT_TRUE(std::filesystem::is_fifo(pipe));
}

TEST(Bench, APictureThatFailsIsSaidAfterTheFiguresAndLeavesTheOldOne) {
  const TemporaryFolder folder;
  // The longest name that a file may have: none is left for the one beside it.
  const std::string name = std::string(251, 'x') + ".svg";
  const std::string picture = folder.write(name, "an old picture");
  const Finished finished = bench({"--plot", picture, "--yes"});
  EXPECT_EQ(read_file(picture), "an old picture");
  EXPECT_EQ(finished.exit_code, 1);
  EXPECT_NE(finished.err.find("plot_failed"), std::string::npos) << finished.err;
  EXPECT_NE(finished.out.find("round trip"), std::string::npos);
}

TEST(TimeBuckets, HoldEveryValueWithinAFifthOfAPercent) {
  for (std::int64_t ns = 1; ns < 60'000'000'000; ns = ns * 9 / 7 + 1) {
    cli::TimeBuckets buckets;
    buckets.add(Time{ns});
    const auto filled = buckets.filled();
    ASSERT_EQ(filled.size(), 1u);
    EXPECT_LE(filled[0].first, Time{ns});
    EXPECT_GE(filled[0].last, Time{ns});
    EXPECT_LE((filled[0].last - filled[0].first).count() * 500, ns) << ns;
  }
}

TEST(TimeBuckets, AnythingGoesSomewhere) {
  cli::TimeBuckets buckets;
  buckets.add(Time{-5});
  buckets.add(kNever);
  for (int k = 1; k <= 98; ++k) buckets.add(Time{k});
  const auto filled = buckets.filled();
  std::uint64_t sum = 0;
  for (const cli::Bucket& bucket : filled) sum += bucket.count;
  EXPECT_EQ(sum, 100u);
}

TEST(TimeBuckets, OfAPortsHistogram) {
  linux_hal::TimeHistogram histogram;
  histogram.add(Time{5});
  for (int k = 0; k < 3; ++k) histogram.add(Time{1'000'000});
  const auto buckets = cli::buckets_of(histogram);
  ASSERT_EQ(buckets.size(), 2u);
  EXPECT_EQ(buckets[0].first, Time{5});
  EXPECT_EQ(buckets[0].last, Time{5});
  EXPECT_EQ(buckets[1].count, 3u);
  EXPECT_LE(buckets[1].first, Time{1'000'000});
  EXPECT_GE(buckets[1].last, Time{1'000'000});
}

}  // namespace
}  // namespace tm485::test
