// The parts of the doctor that need no port: its reading of bytes, its bounds, its look at the machine.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <set>

#include "cli/process.hpp"
#include "doctor/binomial.hpp"
#include "doctor/checks.hpp"
#include "doctor/reading.hpp"

namespace tm485::cli::doctor {
namespace {

using Bytes = std::vector<std::uint8_t>;
using test::TemporaryFolder;

Kind kind_of(const Bytes& bytes, DataId id) {
  Heard heard;
  heard.count = bytes.size();
  std::ranges::copy(bytes, heard.bytes.begin());
  return read(heard, *Request::make(id), false).kind;
}

TEST(DoctorReading, KindsOfBytes) {
  EXPECT_EQ(kind_of({}, DataId::encoder_id), Kind::silence);
  EXPECT_EQ(kind_of({0x92, 0x00, 0x11, 0x83}, DataId::encoder_id), Kind::reply);
  EXPECT_EQ(kind_of({0x92, 0x92, 0x00, 0x11, 0x83}, DataId::encoder_id), Kind::reply);
  EXPECT_EQ(kind_of({0x92}, DataId::encoder_id), Kind::echo);
  EXPECT_EQ(kind_of({0x92, 0x00, 0x11, 0x82}, DataId::encoder_id), Kind::garbage);
  EXPECT_EQ(kind_of({0x02, 0x00, 0x11, 0x13}, DataId::encoder_id),
            Kind::garbage);  // another ID's CF... and CRC
}

TEST(DoctorReading, OnlyTheBeginningIsSpoilt) {
  // CF wrong, the CRC holds for the right one.
  EXPECT_EQ(kind_of({0x55, 0x00, 0x11, 0x83}, DataId::encoder_id), Kind::spoilt_start);
  // CF lost, and one byte too many.
  EXPECT_EQ(kind_of({0x00, 0x11, 0x83}, DataId::encoder_id), Kind::spoilt_start);
  EXPECT_EQ(kind_of({0xFF, 0x55, 0x00, 0x11, 0x83}, DataId::encoder_id), Kind::spoilt_start);
  // CF and SF wrong: SF must have been 20.
  EXPECT_EQ(kind_of({0x55, 0xAA, 0x11, 0xA3}, DataId::encoder_id), Kind::spoilt_start);
  // Five of eleven, by ENID and the bytes that are 0.
  EXPECT_EQ(kind_of({1, 2, 3, 4, 5, 0x11, 5, 0, 0, 0, 0x77}, DataId::everything), Kind::spoilt_start);
  EXPECT_EQ(kind_of({1, 2, 3, 4, 5, 0x12, 5, 0, 0, 0, 0x77}, DataId::everything), Kind::garbage);
  // One bit of ABS: not the beginning.
  EXPECT_EQ(kind_of({0x02, 0x00, 0x01, 0x00, 0x00, 0x02}, DataId::single_turn), Kind::garbage);
}

TEST(DoctorReading, InvertedBytesFromTheBitsByHand) {
  // 1A on the wire: 0 01011000 1; inverted 1 10100111 0. A lead of two bits: space is the start bit, then
  // 0 | 1 1 0 1 0 0 1, the stop bit is the next data bit, 1.
  EXPECT_EQ(inverted(Bytes{0x1A}, 8), (Bytes{0x96}));
  // No lead: it begins with mark; the first space is bit 1. Read: 1 0 0 1 1 1, and space at the stop bit, mark.
  EXPECT_EQ(inverted(Bytes{0x1A}, 0).size(), 1u);
  EXPECT_EQ(kind_of({0x96}, DataId::everything), Kind::inverted);
}

TEST(DoctorBound, IsTheExactOneSided) {
  EXPECT_NEAR(upper_bound_95(0, 4000), 1.0 - std::pow(0.05, 1.0 / 4000), 1e-9);
  EXPECT_NEAR(upper_bound_95(0, 1), 0.95, 1e-9);
  // Published tables of the exact binomial interval: 1 of 10, 5 of 100, 50 of 1000.
  EXPECT_NEAR(upper_bound_95(1, 10), 0.3942, 1e-4);
  EXPECT_NEAR(upper_bound_95(5, 100), 0.1023, 1e-4);
  EXPECT_DOUBLE_EQ(upper_bound_95(7, 7), 1.0);
  EXPECT_GT(upper_bound_95(3999, 4000), 0.9997);
}

TEST(DoctorTable, EveryFindingHasAnUniqueNameACauseAndARemedy) {
  std::set<std::string_view> known;
  for (const FindingInfo& info : kFindings) {
    EXPECT_TRUE(known.insert(info.name).second) << info.name;
    EXPECT_FALSE(info.cause.empty()) << info.name;
    EXPECT_FALSE(info.remedy.empty()) << info.name;
  }
}

Report with_timer(const std::string& text) {
  const TemporaryFolder folder;
  const std::filesystem::path device = folder.path("sys/bus/usb-serial/devices/ttyUSB7");
  std::filesystem::create_directories(device);
  if (!text.empty()) std::ofstream(device / "latency_timer") << text;
  Report report;
  judge_latency_timer(report, "/dev/ttyUSB7", folder.path(""));
  return report;
}

TEST(DoctorMachine, ALatencyTimerThatIsNotSet) {
  const Report slow = with_timer("16\n");
  ASSERT_TRUE(slow.has(FindingId::latency_timer));
  EXPECT_NE(slow.findings().at(0).seen.find("16 ms"), std::string::npos);
  EXPECT_NE(slow.findings().at(0).remedy.find("devices/ttyUSB7/latency_timer"), std::string::npos);
  EXPECT_TRUE(with_timer("1\n").findings().empty());
  EXPECT_EQ(with_timer("1\n").checks().at(0).verdict, "good");
  EXPECT_EQ(with_timer("").checks().at(0).verdict, "skipped");
}

TEST(DoctorMachine, ALinkToThePortLeadsToItsTimer) {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder.path("sys/bus/usb-serial/devices/ttyUSB7"));
  std::ofstream(folder.path("sys/bus/usb-serial/devices/ttyUSB7/latency_timer")) << 16;
  std::ofstream(folder.path("ttyUSB7")) << "";
  std::filesystem::create_symlink(folder.path("ttyUSB7"), folder.path("encoder"));
  Report report;
  judge_latency_timer(report, folder.path("encoder"), folder.path(""));
  EXPECT_TRUE(report.has(FindingId::latency_timer));
}

TEST(DoctorMachine, ReleasesThatCameTooLate) {
  linux_hal::TimeHistogram times;
  for (int k = 0; k < 100; ++k) times.add(Time{2'000});
  Report good;
  judge_release_times(good, times, 0);
  EXPECT_TRUE(good.findings().empty());
  times.add(Time{90'000});
  Report late;
  judge_release_times(late, times, 1);
  ASSERT_TRUE(late.has(FindingId::release_bound));
  EXPECT_NE(late.findings()[0].seen.find("after 1 of 101 requests"), std::string::npos)
      << late.findings()[0].seen;
  EXPECT_NE(late.checks()[0].detail.find("longest 90us"), std::string::npos) << late.checks()[0].detail;
}

TEST(DoctorMachine, TheKernelsSettings) {
  using linux_hal::Verdict;
  Report report;
  judge_kernel(report, {{"kernel", "6.1", Verdict::good, ""},
                        {"rtprio", "0", Verdict::bad, "raise it"},
                        {"isolated", "none", Verdict::improvable, "isolcpus"},
                        {"nohz_full", "?", Verdict::unknown, ""}});
  ASSERT_EQ(report.findings().size(), 2u);
  EXPECT_EQ(report.findings()[0].id, FindingId::kernel_not_realtime);
  EXPECT_EQ(report.findings()[0].seen, "rtprio");
  EXPECT_EQ(report.findings()[1].seen, "isolated");
  EXPECT_TRUE(report.healthy());
  EXPECT_EQ(report.checks().at(0).verdict, "warning");
  Report good;
  judge_kernel(good, {{"kernel", "6.1", Verdict::good, ""}});
  EXPECT_TRUE(good.findings().empty());
}

}  // namespace
}  // namespace tm485::cli::doctor
