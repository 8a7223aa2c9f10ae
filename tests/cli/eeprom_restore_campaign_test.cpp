// tm485 eeprom restore under everything at once: noise that changes requests into other valid ones, lost replies, power
// cuts and a cable that is pulled, at any virtual nanosecond; finished with --resume or taken back with --undo where it
// was interrupted. In this process, in virtual time, on an encoder whose EEPROM outlives each run.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "eeprom_session.hpp"
#include "support/column_flips.hpp"
#include "tm485/sim/faults.hpp"
#include "tm485/sim/simulated_encoder.hpp"
#include "tm485/time.hpp"

namespace tm485::cli {
namespace {

using Json = nlohmann::json;
using ms = std::chrono::milliseconds;
namespace fs = std::filesystem;

constexpr std::size_t kBytes = 889;

/// A folder for small files that are flushed very often: in memory, where there is such a file system.
fs::path make_folder() {
  const fs::path memory = "/dev/shm";
  std::string name =
      ((fs::is_directory(memory) ? memory : fs::temp_directory_path()) / "tm485-XXXXXX").string();
  const char* const made = ::mkdtemp(name.data());
  EXPECT_NE(made, nullptr);
  return name;
}

/// What this process prints, while it lives.
class Printed {
 public:
  Printed() : file_(std::tmpfile()), out_(::dup(STDOUT_FILENO)), err_(::dup(STDERR_FILENO)) {
    std::fflush(stdout);
    ::dup2(::fileno(file_), STDOUT_FILENO);
    ::dup2(::fileno(file_), STDERR_FILENO);
  }
  ~Printed() {
    std::fflush(stdout);
    ::dup2(out_, STDOUT_FILENO);
    ::dup2(err_, STDERR_FILENO);
    ::close(out_);
    ::close(err_);
    std::fclose(file_);
  }
  Printed(const Printed&) = delete;
  Printed& operator=(const Printed&) = delete;
  [[nodiscard]] std::string text() const {
    std::fflush(stdout);
    std::string all(65'536, '\0');
    const ssize_t count = ::pread(::fileno(file_), all.data(), all.size(), 0);
    all.resize(static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
    return all;
  }

 private:
  std::FILE* file_;
  int out_;
  int err_;
};

struct Findings {
  unsigned runs = 0;
  unsigned interrupted = 0;  ///< ended with an error
  unsigned undone = 0;
  unsigned strange = 0;  ///< bytes that an interrupted run left neither as they were nor as wanted
  unsigned flips = 0;
  unsigned cuts = 0;
  unsigned unplugged = 0;
};

/// One image, one encoder, as many runs as it takes.
class World {
 public:
  World(std::uint64_t seed, const fs::path& folder, Findings& findings)
      : dice_(seed), findings_(findings), file_((folder / (std::to_string(seed) + ".bin")).string()) {
    for (std::uint8_t& byte : image_) byte = random_byte();
    first_ = image_;
    wanted_ = image_;
    for (std::int64_t k = 1 + below(40); k > 0; --k)
      wanted_[static_cast<std::size_t>(below(kBytes))] = random_byte();
    std::ofstream(file_, std::ios::binary).write(reinterpret_cast<const char*>(wanted_.data()), kBytes);
    options_.port.port = "sim:";
    options_.port.json = true;
    options_.virtual_time = true;
    options_.file = file_;
    options_.yes = true;
  }

  /// Empty, or what is wrong.
  std::string run() {
    constexpr int kRunsWithFaults = 4;
    for (int i = 0; i < kRunsWithFaults + 1; ++i) {
      const bool faults = i < kRunsWithFaults;
      options_.resume = options_.undo = false;
      if (unfinished()) (below(4) == 0 ? options_.undo : options_.resume) = true;
      const auto start = image_;
      if (!options_.undo && !options_.resume) first_ = image_;
      const int code = one_run(faults);
      const std::string wrong = judge(code, start);
      if (!wrong.empty()) return wrong + "\n" + printed_;
      if (code == 0) return {};
    }
    // What was read while it restarted unnoticed was no backup, and the tool says so.
    if (short_boot_ && printed_.find("tm485: other_encoder:") != std::string::npos) return {};
    return "not done without a fault either\n" + printed_;
  }

 private:
  using Image = std::vector<std::uint8_t>;

  std::int64_t below(std::int64_t n) {
    return static_cast<std::int64_t>(dice_() % static_cast<std::uint64_t>(n));
  }
  std::uint8_t random_byte() { return static_cast<std::uint8_t>(below(3) == 0 ? 0xFF : below(256)); }

  [[nodiscard]] bool unfinished() const {
    std::ifstream journal(file_ + ".journal");
    return journal.good() && Json::parse(journal).at("state") == "unfinished";
  }
  [[nodiscard]] const Image& target() const { return options_.undo ? first_ : wanted_; }

  int one_run(bool faults) {
    ++findings_.runs;
    encoder_.reset();
    int code = 0;
    {
      const Printed printed;
      code =
          run_eeprom_restore(options_, [&](const EepromOptions& options) { return open(options, faults); });
      printed_ = printed.text();
    }
    if (!encoder_) return code;
    if (columns_) findings_.flips += columns_->flips();
    // Whatever was under way comes to its end.
    constexpr Time end = std::chrono::hours(1);
    encoder_->model().advance_to(end);
    const auto settled = encoder_->model().eeprom().settled_image(end);
    image_.assign(settled.begin(), settled.end());
    return code;
  }

  std::expected<EepromSession, Problem> open(const EepromOptions& options, bool faults) {
    sim::SimOptions settings;
    const std::uint64_t seed = dice_();
    settings.encoder.seed = seed;
    settings.encoder.boot_time = short_boot_ ? ms(1) : ms(static_cast<int>(55 + below(300)));
    settings.encoder.eeprom.seed = seed + 1;
    settings.encoder.eeprom.failed_writes = faults && below(3) == 0 ? 0.05 : 0.0;
    settings.encoder.eeprom.power_up_page = static_cast<std::uint8_t>(below(7));
    encoder_ = std::make_shared<sim::SimulatedEncoder>(settings);
    EXPECT_TRUE(encoder_->model().eeprom().set_image(image_));
    SessionOptions session;
    session.port = options.port;
    session.virtual_time = true;
    session.cyclic = false;
    auto opened = Session::on(AnyPort::simulated(encoder_, "sim:"), session);
    if (!opened) return std::unexpected(opened.error());
    auto eeprom = open_eeprom(std::move(*opened));
    if (eeprom && faults) disturb(eeprom->session->now(), seed + 2);
    return eeprom;
  }

  /// Everything that goes wrong in one run, from `now` on.
  void disturb(Time now, std::uint64_t seed) {
    bits_ = std::make_unique<sim::BitErrors>(below(2) == 0 ? 0.0 : 1e-4, below(2) == 0 ? 0.0 : 1e-5, seed);
    lost_ = std::make_unique<sim::LostCharacters>(below(2) == 0 ? 0.0 : 0.005, 0.0, seed + 1);
    columns_ = std::make_unique<test::ColumnFlips>(below(2) == 0 ? 0.0 : 0.02, seed + 2);
    chain_ = std::make_unique<sim::FaultChain>();
    chain_->add(*bits_);
    chain_->add(*lost_);
    chain_->add(*columns_);
    encoder_->line().set_fault_hook(chain_.get());
    // Of the first 0.8 s: reading everything, and the writes.
    Time at = now;
    for (std::int64_t cuts = short_boot_ ? 4 : below(3); cuts > 0; --cuts) {
      at += Time{below(short_boot_ ? 250'000'000 : 400'000'000)};
      EXPECT_TRUE(encoder_->model().power_off(at));
      at += Time{1'000'000 + below(short_boot_ ? 3'000'000 : 100'000'000)};
      EXPECT_TRUE(encoder_->model().power_on(at));
      at += ms(1);
      ++findings_.cuts;
    }
    if (below(2) == 0) {
      encoder_->port().unplug(now + Time{below(800'000'000)});
      ++findings_.unplugged;
    }
  }

  std::string judge(int code, const Image& start) {
    if (code == 0) {
      if (options_.undo) ++findings_.undone;
      return image_ == target() ? std::string() : "it says done, and the encoder holds something else";
    }
    ++findings_.interrupted;
    if (printed_.find("tm485: ") == std::string::npos) return "a failure without a name";
    for (std::size_t i = 0; i < kBytes && !short_boot_; ++i) {
      if (image_[i] == start[i]) continue;
      if (image_[i] == target()[i] && unfinished()) continue;
      ++findings_.strange;
      if (!named(i))
        return "page " + std::to_string(i / 127) + ", address " + std::to_string(i % 127) + " is not named";
    }
    return {};
  }

  [[nodiscard]] bool named(std::size_t at) const {
    const std::size_t begin = printed_.find('{');
    const std::size_t end = printed_.find('\n', begin);
    if (begin == std::string::npos) return false;
    const Json json = Json::parse(printed_.substr(begin, end - begin));
    for (const Json& one : json.at("suspects"))
      if (one.at("page") == at / 127 && one.at("address") == at % 127) return true;
    for (const Json& page : json.at("unconfirmed_pages"))
      if (page == at / 127) return true;
    if (!json.contains("in_doubt")) return false;
    const Json& doubt = json.at("in_doubt");
    for (const Json& page : doubt.at("pages"))
      if (page == at / 127) return true;
    return doubt.at("page") == at / 127 && doubt.at("address") == at % 127;
  }

  std::mt19937_64 dice_;
  /// Against the assumption: a restart between two exchanges goes unnoticed. What is called done must be so all the same.
  bool short_boot_ = below(10) == 0;
  Findings& findings_;
  std::string file_;
  EepromOptions options_;
  Image image_ = Image(kBytes);
  Image first_;
  Image wanted_;
  std::string printed_;
  std::shared_ptr<sim::SimulatedEncoder> encoder_;
  std::unique_ptr<sim::BitErrors> bits_;
  std::unique_ptr<sim::LostCharacters> lost_;
  std::unique_ptr<test::ColumnFlips> columns_;
  std::unique_ptr<sim::FaultChain> chain_;
};

TEST(EepromRestoreCampaign, EndsWithTheWantedImageOrNamesWhatIsWrong) {
  const char* const wish = std::getenv("TM485_RESTORE_SEEDS");
  const int seeds = wish == nullptr ? 1'000 : std::atoi(wish);
  const fs::path folder = make_folder();
  Findings f;
  for (int seed = 1; seed <= seeds; ++seed) {
    const std::string wrong = World(static_cast<std::uint64_t>(seed) * 104'729, folder, f).run();
    ASSERT_EQ(wrong, "") << "seed " << seed;
  }
  fs::remove_all(folder);
  EXPECT_GT(f.interrupted, f.runs / 5);
  EXPECT_GT(f.undone, 0U);
  EXPECT_GT(f.strange, 0U);
  EXPECT_GT(f.flips, 0U);
  std::printf(
      "%d images, %u runs: %u interrupted, %u taken back; %u flips, %u power cuts, %u pulled cables; %u "
      "bytes "
      "left strange, all of them named\n",
      seeds, f.runs, f.interrupted, f.undone, f.flips, f.cuts, f.unplugged, f.strange);
}

}  // namespace
}  // namespace tm485::cli
