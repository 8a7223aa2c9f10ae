// The EEPROM manager on the simulated encoder, under everything at once: requests that noise turns into other valid
// requests, requests and replies that are changed or lost, an EEPROM that is slower than stated, writes that do not take,
// and power cuts at any instant. When it says that it is done, the encoder holds exactly what was wanted and nothing else
// has changed. Managers that leave one precaution out are found.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <vector>

#include "support/column_flips.hpp"
#include "support/print.hpp"
#include "support/profiles.hpp"
#include "tm485/bus/eeprom.hpp"
#include "tm485/sim/encoder_model.hpp"
#include "tm485/sim/faults.hpp"
#include "tm485/sim/line.hpp"
#include "tm485/sim/sim_port.hpp"

namespace tm485 {
namespace {

using test::ms;
using test::us;

struct Findings {
  unsigned done = 0;
  unsigned refused = 0;
  unsigned wrong = 0;  ///< said done, and it is not so
  unsigned flips = 0;
  unsigned cuts = 0;
  unsigned spoiled = 0;
  unsigned repaired = 0;
  unsigned open = 0;     ///< neither done nor refused in time
  unsigned strange = 0;  ///< bytes that are neither old nor new where a task was cut off
  unsigned unnamed = 0;  ///< and that the manager had not named as in doubt
};

/// One task on one encoder.
template <class Discipline>
class World {
 public:
  explicit World(std::uint64_t seed)
      : dice_(seed),
        profile_(test::compiled(below(2) == 0 ? "tm485_17" : "tformat_17")),
        model_(config(seed)),
        line_(&model_, {}),
        port_(line_, {}),
        bits_(below(2) == 0 ? 0.0 : 1e-4, below(2) == 0 ? 0.0 : 1e-4, seed + 1),
        lost_(below(2) == 0 ? 0.0 : 0.01, below(2) == 0 ? 0.0 : 0.001, seed + 2),
        columns_(below(2) == 0 ? 0.0 : 0.03, seed + 3),
        bus_(port_, profile_, bus_config()),
        manager_(profile_, {std::span(value_).first(size()), std::span(known_).first(size())}),
        before_(size()) {
    for (std::uint8_t& byte : before_) byte = static_cast<std::uint8_t>(below(4) == 0 ? 0 : below(256));
    EXPECT_TRUE(model_.eeprom().set_image(before_));
    std::copy(before_.begin(), before_.end(), value_.begin());
    known_.fill(true);  // as after a backup
    faults_.add(bits_);
    faults_.add(lost_);
    faults_.add(columns_);
  }

  void run(Findings& findings) {
    EXPECT_TRUE(bus_.start(now_));
    while (bus_.state() != BusState::running) step();
    line_.set_fault_hook(&faults_);
    begin_task();
    draw_cut();
    const Time end = now_ + std::chrono::seconds(60);
    while (manager_.active() && now_ < end) {
      step();
      if (now_ >= next_cut_) cut(findings);
    }
    findings.flips += columns_.flips();
    findings.spoiled += static_cast<unsigned>(model_.eeprom().spoiled_bytes());
    findings.repaired += manager_.progress().repaired;
    if (manager_.active()) {
      ++findings.open;
      return;
    }
    if (manager_.outcome()->code != Errc::ok) {
      ++findings.refused;
      return;
    }
    ++findings.done;
    const auto image = final_image();
    if (!std::equal(expected_.begin(), expected_.end(), image.begin())) ++findings.wrong;
  }

  /// The cable is pulled in the middle, and the encoder's supply may fail at the same time.
  void run_cut_off(Findings& findings) {
    EXPECT_TRUE(bus_.start(now_));
    while (bus_.state() != BusState::running) step();
    line_.set_fault_hook(&faults_);
    begin_task();
    const Time end = now_ + Time{below(400'000'000)};
    while (manager_.active() && now_ < end) step();
    if (below(2) == 0) {
      EXPECT_TRUE(model_.power_off(now_ + Time{below(12'000'000)}));
    }
    if (!manager_.active() && manager_.outcome()->code == Errc::ok) return;
    ++findings.done;
    const auto doubt = manager_.in_doubt();
    const auto image = final_image();
    for (unsigned i = 0; i < before_.size(); ++i) {
      if (image[i] == before_[i] || image[i] == expected_[i]) continue;
      ++findings.strange;
      const unsigned page_bytes = profile_.profile().eeprom_page_bytes;
      const unsigned page = i / page_bytes;
      const bool named = doubt && ((doubt->pages >> page & 1U) != 0 ||
                                   (doubt->page == page && doubt->address == i % page_bytes));
      if (!named) ++findings.unnamed;
    }
  }

 private:
  void begin_task() {
    const auto count = static_cast<unsigned>(1 + below(30));
    const auto first = static_cast<unsigned>(below(static_cast<std::int64_t>(before_.size() - count + 1)));
    wanted_.assign(before_.begin() + first, before_.begin() + first + count);
    for (std::uint8_t& byte : wanted_)
      if (below(3) != 0) byte = static_cast<std::uint8_t>(below(4) == 0 ? 0 : below(256));
    EXPECT_TRUE(manager_.start_write(first, wanted_));
    expected_.assign(before_.begin(), before_.end());
    std::copy(wanted_.begin(), wanted_.end(), expected_.begin() + first);
  }
  auto final_image() {
    model_.advance_to(now_ + ms(200));
    return model_.eeprom().settled_image(now_ + ms(200));
  }

  std::int64_t below(std::int64_t n) {
    return static_cast<std::int64_t>(dice_() % static_cast<std::uint64_t>(n));
  }
  sim::EncoderConfig config(std::uint64_t seed) {
    sim::EncoderConfig c;
    if (profile_.profile().name == "tformat_17") c.flavour = sim::Flavour::t_format;
    c.enid = profile_.profile().enids.values[0];
    c.boot_time = ms(static_cast<int>(55 + below(300)));
    c.seed = seed + 5;
    c.eeprom.write_time_max = ms(static_cast<int>(10 + below(2) * 6));
    if (below(2) == 0) c.eeprom.page_time = ms(static_cast<int>(18 + below(3) * 8));
    c.eeprom.failed_writes = below(3) == 0 ? 0.05 : 0.0;
    c.eeprom.pages = profile_.profile().eeprom_pages;
    c.eeprom.seed = seed + 6;
    return c;
  }
  [[nodiscard]] std::size_t size() const {
    return std::size_t{profile_.profile().eeprom_pages} * profile_.profile().eeprom_page_bytes;
  }
  static BusConfig bus_config() {
    BusConfig c;
    c.cycle = std::nullopt;
    return c;
  }

  void step() {
    const Time due = bus_.poll(now_);
    const Time manager = drive(manager_, bus_, now_);
    const Time event = line_.next_event();
    Time next = std::min({due, manager, event > now_ ? event : kNever});
    if (manager == kNever && manager_.under_way()) next = std::min(next, bus_.poll(now_));
    now_ = std::max(std::min(next, now_ + ms(1)), now_);
    if (next <= now_ && ++in_place_ > 50) now_ += Time{100};
    if (next > now_) in_place_ = 0;
  }
  void draw_cut() { next_cut_ = cuts_ ? now_ + Time{below(60'000'000)} : kNever; }
  void cut(Findings& findings) {
    ++findings.cuts;
    const Time off = now_ + us(50);
    const bool taken = model_.power_off(off) && model_.power_on(off + Time{1'000'000 + below(40'000'000)});
    EXPECT_TRUE(taken);
    if (--cuts_left_ == 0) {
      next_cut_ = kNever;
    } else {
      next_cut_ = now_ + ms(500) + Time{below(300'000'000)};
    }
  }

  std::mt19937_64 dice_;
  CompiledProfile profile_;
  bool cuts_ = below(2) == 0;
  int cuts_left_ = 3;
  sim::EncoderModel model_;
  sim::Line line_;
  sim::SimPort port_;
  sim::BitErrors bits_;
  sim::LostCharacters lost_;
  test::ColumnFlips columns_;
  sim::FaultChain faults_;
  std::array<std::uint8_t, sim::EepromModel::kBytes> value_{};
  std::array<bool, sim::EepromModel::kBytes> known_{};
  Bus<sim::SimPort> bus_;
  BasicEepromManager<Discipline> manager_;
  std::vector<std::uint8_t> before_;
  std::vector<std::uint8_t> wanted_;
  std::vector<std::uint8_t> expected_;
  Time now_{0};
  Time next_cut_ = kNever;
  int in_place_ = 0;
};

template <class Discipline>
Findings campaign(unsigned seeds, unsigned enough_wrong) {
  Findings findings;
  for (unsigned seed = 1; seed <= seeds && findings.wrong < enough_wrong; ++seed) {
    const unsigned before = findings.wrong;
    World<Discipline>(seed * 7'919).run(findings);
    if (findings.wrong != before && enough_wrong > 1) ADD_FAILURE() << "wrong with seed " << seed;
  }
  return findings;
}

TEST(EepromCampaign, WhatIsCalledDoneIsSo) {
  const Findings f = campaign<EepromDiscipline>(3'000, 3);
  EXPECT_EQ(f.wrong, 0U);
  EXPECT_EQ(f.open, 0U);
  EXPECT_GT(f.done, 2'500U);
  EXPECT_GT(f.flips, 500U);
  EXPECT_GT(f.cuts, 500U);
  EXPECT_GT(f.spoiled, 20U);
  EXPECT_GT(f.repaired, 50U);
  RecordProperty("refused", static_cast<int>(f.refused));
  std::printf("done %u, refused %u, column flips %u, power cuts %u, bytes spoiled %u, repaired %u\n", f.done,
              f.refused, f.flips, f.cuts, f.spoiled, f.repaired);
}

TEST(EepromCampaign, WhatIsCutOffIsNamed) {
  Findings f;
  for (unsigned seed = 1; seed <= 6'000; ++seed) {
    const unsigned before = f.unnamed;
    World<EepromDiscipline>(seed * 7'919).run_cut_off(f);
    if (f.unnamed != before) ADD_FAILURE() << "a byte that nobody has named, with seed " << seed;
  }
  EXPECT_GT(f.done, 1'000U);
  EXPECT_GT(f.strange, 200U);
  std::printf("cut off %u, bytes neither old nor new %u, of them unnamed %u\n", f.done, f.strange, f.unnamed);
}

struct NoBusyCheck : EepromDiscipline {
  static constexpr bool kChecksBusy = false;
};
struct NoPageCheck : EepromDiscipline {
  static constexpr bool kChecksPage = false;
};
struct NoReadBack : EepromDiscipline {
  static constexpr bool kReadsBack = false;
};
struct NoEchoCompare : EepromDiscipline {
  static constexpr bool kComparesEcho = false;
};

template <class Discipline>
class EepromTwin : public testing::Test {};
using Twins = testing::Types<NoBusyCheck, NoPageCheck, NoReadBack, NoEchoCompare>;
TYPED_TEST_SUITE(EepromTwin, Twins);

TYPED_TEST(EepromTwin, IsFound) { EXPECT_EQ(campaign<TypeParam>(3'000, 1).wrong, 1U); }

}  // namespace
}  // namespace tm485
