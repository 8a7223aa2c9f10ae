// tm485 eeprom restore: done, identical, interrupted, finished, taken back, refused.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <thread>

#include "cli/process.hpp"
#include "cli/simulator.hpp"
#include "cli/terminal.hpp"
#include "eeprom_journal.hpp"

namespace tm485::test {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kBytes = 889;
constexpr double kFullWriteNs = 889 * 10e6 + 7 * 18e6;

std::string content(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// Bytes of which none is FF and no two pages are alike.
std::string pattern(std::size_t size = kBytes) {
  std::string bytes(size, '\0');
  for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<char>((i * 37 + i / 127) % 255);
  return bytes;
}

Json object(const Finished& finished) {
  EXPECT_EQ(finished.lines().size(), 1U) << finished.out << finished.err;
  return finished.lines().empty() ? Json() : Json::parse(finished.lines().at(0));
}

void expect_refused(const Finished& finished, const std::string& name) {
  EXPECT_EQ(finished.exit_code, 2) << finished.err;
  EXPECT_NE(finished.err.find("tm485: " + name + ":"), std::string::npos) << finished.err;
  EXPECT_NE(finished.err.find("remedy:"), std::string::npos) << finished.err;
}

Process::Arguments restore(const std::string& port, const std::string& file,
                           const Process::Arguments& more = {}) {
  Process::Arguments arguments{"eeprom", "restore", port, file};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

std::string journal_state(const std::string& file) {
  return Json::parse(content(file + ".journal")).at("state");
}
void set_journal_state(const std::string& file, const std::string& state) {
  Json journal = Json::parse(content(file + ".journal"));
  journal["state"] = state;
  std::ofstream(file + ".journal") << journal.dump();
}

TEST(EepromRestore, WritesAllOfItWithinTheLimit) {
  const TemporaryFolder folder;
  const std::string file = folder.write("new.bin", pattern());
  const Json json = object(run(restore("sim:", file, {"--yes", "--virtual", "--json"})));
  for (const char* key : {"port", "file", "profile", "action", "outcome", "journal", "backup", "crc32"})
    EXPECT_TRUE(json.at(key).is_string()) << key;
  for (const char* key : {"enid", "bytes", "differing", "writes", "page_selects", "retries", "repaired",
                          "read_ns", "write_ns", "verify_ns", "total_ns"})
    EXPECT_TRUE(json.at(key).is_number_integer()) << key;
  EXPECT_EQ(json.at("outcome"), "done");
  EXPECT_EQ(json.at("differing"), kBytes);
  EXPECT_EQ(json.at("writes"), kBytes);
  EXPECT_EQ(json.at("suspects"), Json::array());
  EXPECT_LE(json.at("write_ns").get<double>(), 1.02 * kFullWriteNs);
  EXPECT_LE(json.at("total_ns").get<double>(), 1.05 * kFullWriteNs);
  EXPECT_EQ(journal_state(file), "restored");
  const Json backup = Json::parse(content(json.at("backup")));
  EXPECT_EQ(backup.at("crc32"), "B3DE789A");  // 889 bytes FF
}

TEST(EepromRestore, AnIdenticalImageCostsNothing) {
  const TemporaryFolder folder;
  const std::string file = folder.write("same.bin", std::string(kBytes, '\xFF'));
  const Json json = object(run(restore("sim:", file, {"--yes", "--virtual", "--json"})));
  EXPECT_EQ(json.at("outcome"), "identical");
  EXPECT_EQ(json.at("writes"), 0);
  EXPECT_LE(json.at("total_ns").get<double>(), 2 * 161.56e6);
  EXPECT_FALSE(std::filesystem::exists(file + ".journal"));
}

TEST(EepromRestore, OnlyWhatDiffersIsWritten) {
  const TemporaryFolder folder;
  std::string bytes(kBytes, '\xFF');
  bytes[3] = bytes[500] = bytes[888] = '\x42';
  const std::string file = folder.write("new.bin", bytes);
  const Json json = object(run(restore("sim:ber=1e-4", file, {"--yes", "--virtual", "--json"})));
  EXPECT_EQ(json.at("outcome"), "done");
  EXPECT_EQ(json.at("differing"), 3);
  EXPECT_GE(json.at("writes"), 3);
  EXPECT_LE(json.at("writes"), 10);
  EXPECT_GT(json.at("retries"), 0);
}

/// Replies with two errors that cancel in the checksum: some byte is misread at the end, seen as wrong, and looked at again.
TEST(EepromRestore, WhatIsWrongAtTheEndIsDealtWithAgain) {
  const TemporaryFolder folder;
  std::string bytes(kBytes, '\xFF');
  bytes[300] = '\x01';
  const std::string file = folder.write("new.bin", bytes);
  int done = 0;
  int again = 0;
  for (int seed = 1; seed <= 40; ++seed) {
    const std::string port = std::string("sim:ber=0:4e-3,seed=").append(std::to_string(seed));
    const Finished finished = run(restore(
        port, file,
        {"--yes", "--virtual", "--json", "--journal", folder.path(std::to_string(seed) + ".journal")}));
    if (finished.exit_code != 0) continue;  // the line is too bad for start-up, or for three rounds
    ++done;
    again += object(finished).at("rounds") > 1 ? 1 : 0;
  }
  EXPECT_GT(done, 5);
  EXPECT_GT(again, 0);
}

TEST(EepromRestore, WhatDoesNotFitIsRefusedBeforeAnythingIsTouched) {
  const TemporaryFolder folder;
  const std::string good = folder.path("good.json");
  ASSERT_EQ(run({"eeprom", "dump", "sim:", "-o", good, "--virtual"}).exit_code, 0);
  std::string damaged = content(good);
  damaged[damaged.find("FFFF")] = '0';
  const Process::Arguments yes{"--yes", "--virtual"};
  expect_refused(run(restore("sim:", folder.write("bad.json", damaged), yes)), "image_checksum");
  expect_refused(run(restore("sim:profile=tformat_17", good, yes)), "image_size");
  expect_refused(run(restore("sim:", folder.write("short.bin", pattern(762)), yes)), "image_size");
  expect_refused(run(restore("sim:", folder.path("none.bin"), yes)), "file_failed");
  expect_refused(run(restore("sim:", good, {"--virtual"})), "not_confirmed");
  expect_refused(run(restore("sim:", good, {"--yes", "--virtual", "--resume"})), "no_journal");
  expect_refused(run(restore("sim:", good, {"--yes", "--virtual", "--undo"})), "no_journal");
  EXPECT_EQ(run(restore("sim:", good, {"--yes", "--resume", "--undo"})).exit_code, 2);
  expect_refused(run(restore("sim:", good, {"--yes", "--virtual", "--journal", folder.write("j", "{}")})),
                 "bad_journal");
  const std::string file = folder.write("new.bin", pattern());
  expect_refused(run(restore("sim:", file, {"--yes", "--virtual", "--backup", good})), "file_exists");
  EXPECT_FALSE(std::filesystem::exists(file + ".journal"));
}

TEST(EepromRestore, AsksAtATerminalAndShowsHowFarItIs) {
  const TemporaryFolder folder;
  const std::string file = folder.write("new.bin", pattern());
  const Finished no = run_at_terminal(restore("sim:", file, {"--virtual"}), "(type yes)", "no");
  EXPECT_EQ(no.exit_code, 2);
  EXPECT_NE(no.out.find("write 889 of 889 bytes (about 8.9 s)?"), std::string::npos) << no.out;
  EXPECT_NE(no.out.find("tm485: declined:"), std::string::npos) << no.out;
  EXPECT_FALSE(std::filesystem::exists(file + ".journal"));
  const Finished yes = run_at_terminal(restore("sim:", file, {"--virtual"}), "(type yes)", "yes");
  EXPECT_EQ(yes.exit_code, 0) << yes.out;
  EXPECT_NE(yes.out.find("writing   [...."), std::string::npos) << yes.out;
  EXPECT_NE(yes.out.find("889 bytes, 4."), std::string::npos) << yes.out;  // half-way: seconds left
  EXPECT_NE(yes.out.find("verified    all 889 bytes"), std::string::npos) << yes.out;
}

TEST(EepromRestore, OneImageOnTwoEncodersGivesEachItsOwnBytesBack) {
  const TemporaryFolder folder;
  const std::string file = folder.write("new.bin", pattern());
  const Process::Arguments yes{"--yes", "--virtual"};
  ASSERT_EQ(run(restore("sim:seed=1", file, yes)).exit_code, 0);
  const Finished second = run(restore("sim:seed=2", file, yes));
  ASSERT_EQ(second.exit_code, 0) << second.err;
  EXPECT_NE(second.out.find("--journal " + file + ".journal-2 --undo"), std::string::npos) << second.out;
  EXPECT_EQ(Json::parse(content(file + ".journal")).at("port"), "sim:seed=1") << "not replaced";
  EXPECT_EQ(Json::parse(content(file + ".journal-2")).at("port"), "sim:seed=2");
  const Finished undo = run(restore("sim:seed=1", file, {"--yes", "--virtual", "--undo"}));
  expect_refused(undo, "which_journal");
  EXPECT_NE(undo.err.find("on sim:seed=2"), std::string::npos) << undo.err;
}

TEST(EepromRestore, AnotherEncoderIsNotWrittenToBeforeItIsKnown) {
  const TemporaryFolder folder;
  const std::string file = folder.write("new.bin", pattern());
  cli::EepromJournal journal;
  journal.wanted.shape = journal.before.shape = {7, 127};
  const std::string wanted = pattern();
  journal.wanted.bytes.assign(wanted.begin(), wanted.end());
  journal.before.bytes.assign(kBytes, 0);  // that of the simulated one is FF
  journal.before.bytes[700] = journal.wanted.bytes[700];
  unsigned refused = 0;
  for (int seed = 1; seed <= 25; ++seed) {
    ASSERT_TRUE(cli::save_journal(file + ".journal", journal));
    const Finished lossy = run(restore("sim:eeprom_start=3,lost=0.05,seed=" + std::to_string(seed), file,
                                       {"--yes", "--virtual", "--json", "--resume"}));
    if (lossy.exit_code != 2) continue;
    ++refused;
    EXPECT_EQ(object(lossy).at("writes"), 0) << seed;
  }
  EXPECT_GT(refused, 20U);
}

TEST(EepromRestore, AJournalThatNestsForEverIsRefused) {
  const TemporaryFolder folder;
  const std::string file = folder.write("new.bin", pattern());
  const std::string deep =
      "{\"format\":\"tm485-eeprom-journal\",\"version\":1,\"state\":\"unfinished\",\"wanted\":" +
      std::string(60'000, '[') + std::string(60'000, ']') + "}";
  expect_refused(run(restore("sim:", file, {"--yes", "--virtual", "--journal", folder.write("j", deep)})),
                 "bad_journal");
}

TEST(EepromRestore, BackupAndJournalAreTwoFiles) {
  const TemporaryFolder folder;
  const std::string file = folder.write("new.bin", pattern());
  const std::string one = folder.path("one");
  expect_refused(run(restore("sim:", file, {"--yes", "--virtual", "--backup", one, "--journal", one})),
                 "same_file");
  EXPECT_FALSE(std::filesystem::exists(one));
}

TEST(EepromRestore, AWornEepromIsAFailureThatNamesTheByte) {
  const TemporaryFolder folder;
  const std::string file = folder.write("new.bin", pattern());
  const Finished finished = run(restore("sim:eeprom_fail=1", file, {"--yes", "--virtual", "--json"}));
  EXPECT_EQ(finished.exit_code, 1);
  EXPECT_EQ(object(finished).at("outcome"), "failed");
  EXPECT_NE(finished.err.find("page "), std::string::npos) << finished.err;
  EXPECT_NE(finished.err.find("found FF"), std::string::npos) << finished.err;
  EXPECT_NE(finished.err.find("--resume"), std::string::npos) << finished.err;
  EXPECT_EQ(journal_state(file), "unfinished");
}

/// An encoder of one page behind a socket, so that a restore takes little more than a second of real time.
class OnePage : public testing::Test {
 protected:
  static constexpr std::size_t kPage = 127;

  OnePage() {
    profile_ = folder_.write("one_page.toml", "base = \"tm485_17\"\neeprom_pages = 1\n");
    eeprom_ = folder_.write("eeprom.bin", before_);
    file_ = folder_.write("new.bin", wanted_);
  }
  [[nodiscard]] Process::Arguments simulator() const {
    return {"--unix", folder_.path("socket"), "--eeprom", eeprom_, "--eeprom-pages", "1"};
  }
  /// One whose cells are so slow that a test which is held up for seconds still comes in the middle.
  [[nodiscard]] Process::Arguments slow_simulator() const {
    Process::Arguments arguments = simulator();
    arguments.insert(arguments.end(), {"--eeprom-write", "60ms"});
    return arguments;
  }
  [[nodiscard]] Process::Arguments command(const Process::Arguments& more) const {
    Process::Arguments all{"--yes", "--json", "--profile", profile_};
    all.insert(all.end(), more.begin(), more.end());
    return restore("unix:" + folder_.path("socket"), file_, all);
  }
  /// A restore that has written some bytes, and not all of them.
  void wait_for_first_bytes() const {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (content(eeprom_) == before_ && std::chrono::steady_clock::now() < end)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    EXPECT_NE(content(eeprom_), before_);
  }
  /// The journal of a restore that was begun, and an encoder that a power failure has left in the middle.
  void leave_in_the_middle() {
    {
      Simulator begun(simulator());
      EXPECT_EQ(run(command({})).exit_code, 0);
    }
    set_journal_state(file_, "unfinished");
    std::string half = wanted_.substr(0, 60) + '\x5A' + before_.substr(61);
    (void)folder_.write("eeprom.bin", half);
  }

  TemporaryFolder folder_;
  std::string before_ = std::string(kPage, 'b');
  std::string wanted_ = pattern(kPage);
  std::string profile_;
  std::string eeprom_;
  std::string file_;
};

TEST_F(OnePage, ResumeFinishesWhatWasInterrupted) {
  leave_in_the_middle();
  Simulator simulator(this->simulator());
  expect_refused(run(command({})), "unfinished_restore");
  const Json json = object(run(command({"--resume"})));
  EXPECT_EQ(json.at("outcome"), "done");
  EXPECT_EQ(json.at("action"), "resume");
  EXPECT_EQ(json.at("differing"), 67);
  EXPECT_EQ(content(eeprom_), wanted_);
  EXPECT_EQ(journal_state(file_), "restored");
  expect_refused(run(command({"--resume"})), "nothing_to_do");
}

TEST_F(OnePage, UndoTakesItBackAlsoAfterwards) {
  leave_in_the_middle();
  Simulator simulator(this->simulator());
  const Json json = object(run(command({"--undo"})));
  EXPECT_EQ(json.at("outcome"), "done");
  EXPECT_EQ(json.at("action"), "undo");
  EXPECT_EQ(content(eeprom_), before_);
  EXPECT_EQ(journal_state(file_), "undone");
  expect_refused(run(command({"--undo"})), "nothing_to_do");
  EXPECT_EQ(run(command({})).exit_code, 0);
  EXPECT_EQ(content(eeprom_), wanted_);
  std::filesystem::remove(file_);  // the journal has all that is needed
  EXPECT_EQ(run(command({"--undo"})).exit_code, 0);
  EXPECT_EQ(content(eeprom_), before_);
}

TEST_F(OnePage, AnotherEncoderOrAnotherImageIsRefused) {
  leave_in_the_middle();
  (void)folder_.write("eeprom.bin", std::string(kPage, 'x'));
  Simulator simulator(this->simulator());
  expect_refused(run(command({"--resume"})), "other_encoder");
  EXPECT_EQ(content(eeprom_), std::string(kPage, 'x'));
  (void)folder_.write("new.bin", std::string(kPage, 'y'));
  expect_refused(run(command({"--resume"})), "other_image");
}

TEST_F(OnePage, CtrlCSaysWhatWasDoneAndUndoBringsItBack) {
  Simulator simulator(slow_simulator());
  Process process(command({}));
  wait_for_first_bytes();
  process.send_signal(SIGINT);
  const Finished finished = process.wait();
  EXPECT_EQ(finished.exit_code, 1);
  EXPECT_EQ(object(finished).at("outcome"), "stopped");
  EXPECT_NE(finished.err.find("tm485: stopped: stopped after "), std::string::npos) << finished.err;
  EXPECT_NE(finished.err.find("--undo brings the old bytes back"), std::string::npos) << finished.err;
  EXPECT_EQ(journal_state(file_), "unfinished");
  EXPECT_NE(content(eeprom_), wanted_);
  EXPECT_EQ(run(command({"--undo"})).exit_code, 0);
  EXPECT_EQ(content(eeprom_), before_);
}

TEST_F(OnePage, ASimulatorThatIsKilledIsNoticedAndResumed) {
  {
    Simulator simulator(slow_simulator());
    Process process(command({}));
    wait_for_first_bytes();
    simulator.process().send_signal(SIGKILL);
    const Finished finished = process.wait();
    EXPECT_EQ(finished.exit_code, 1);
    EXPECT_EQ(object(finished).at("outcome"), "failed");
    EXPECT_NE(finished.err.find("tm485: port_gone:"), std::string::npos) << finished.err;
    EXPECT_NE(finished.err.find("--resume finishes"), std::string::npos) << finished.err;
  }
  EXPECT_NE(content(eeprom_), wanted_);
  std::filesystem::remove(folder_.path("socket"));
  Simulator again(this->simulator());
  EXPECT_EQ(run(command({"--resume"})).exit_code, 0);
  EXPECT_EQ(content(eeprom_), wanted_);
}

TEST_F(OnePage, ACommandThatIsKilledIsResumed) {
  Simulator simulator(slow_simulator());
  {
    Process process(command({}));
    wait_for_first_bytes();
    process.send_signal(SIGKILL);
    EXPECT_EQ(process.wait().signal, SIGKILL);
  }
  EXPECT_EQ(journal_state(file_), "unfinished");
  EXPECT_EQ(run(command({"--resume"})).exit_code, 0);
  EXPECT_EQ(content(eeprom_), wanted_);
}

}  // namespace
}  // namespace tm485::test
