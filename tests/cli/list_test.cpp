// tm485 list on a /sys and a /dev made for it, and commands that outlive their port.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "cli/process.hpp"
#include "cli/simulator.hpp"
#include "support/fake_sysfs.hpp"

namespace tm485::test {
namespace {

using Json = nlohmann::json;

Finished list(const FakeSysfs& system, const std::vector<std::string>& more = {}) {
  Process::Arguments arguments{"list", "--sysfs-root", system.sys(), "--dev-root", system.dev()};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return run(arguments);
}

TEST(List, WithoutAPortSaysSoAndHowToSimulate) {
  const FakeSysfs system;
  const Finished finished = list(system);
  EXPECT_EQ(finished.exit_code, 0);
  EXPECT_NE(finished.out.find("No serial port"), std::string::npos) << finished.out;
  EXPECT_NE(finished.out.find("sim:"), std::string::npos) << finished.out;
  const Finished json = list(system, {"--json"});
  EXPECT_EQ(json.exit_code, 0);
  EXPECT_TRUE(json.out.empty()) << json.out;
}

TEST(List, NamesChipDriverStableNameAndWhatItHolds) {
  FakeSysfs system;
  system.add_usb("ttyUSB0", {"0403", "6014", "0900", "ftdi_sio", "480", "FTGOOD", "C232HM", "16"});
  system.add_usb("ttyUSB1", {"0403", "6001", "0600", "ftdi_sio", "12", "FTBAD", "FT232R USB UART", "1"});
  system.add_usb("ttyACM0", {"2341", "0043", "0001", "cdc_acm", "12", "UNO", "Uno"});
  system.add_uart("ttyAMA0", "uart-pl011", 48'000'000);
  std::vector<Json> ports;
  for (const std::string& line : list(system, {"--json"}).lines()) ports.push_back(Json::parse(line));
  ASSERT_EQ(ports.size(), 4U);
  const auto port = [&](const std::string& name) {
    for (const Json& candidate : ports)
      if (candidate.at("path") == system.dev(name)) return candidate;
    ADD_FAILURE() << name;
    return Json{};
  };
  const Json good = port("ttyUSB0");
  EXPECT_EQ(good.at("chip"), "FT232H");
  EXPECT_EQ(good.at("driver"), "ftdi_sio");
  EXPECT_EQ(good.at("stable_path"), system.by_id("FTGOOD"));
  EXPECT_EQ(good.at("usb_id"), "0403:6014");
  EXPECT_EQ(good.at("rate").at("verdict"), "holds");
  EXPECT_NEAR(good.at("rate").at("error_percent").get<double>(), 1.05, 0.01);
  EXPECT_EQ(good.at("latency_timer_ms"), 16);
  EXPECT_EQ(good.at("shortest_exchange_ns"), 1'000'000) << "with the timer that opening sets";
  EXPECT_EQ(good.at("access"), "free");
  EXPECT_EQ(port("ttyUSB1").at("rate").at("verdict"), "cannot");
  EXPECT_EQ(port("ttyUSB1").at("rate").at("nearest"), 2'000'000);
  EXPECT_EQ(port("ttyACM0").at("rate").at("verdict"), "unknown");
  EXPECT_EQ(port("ttyACM0").at("product"), "Uno");
  EXPECT_EQ(port("ttyAMA0").at("chip"), "PL011");
  EXPECT_EQ(port("ttyAMA0").at("uart_clock_hz"), 48'000'000);
  EXPECT_EQ(port("ttyAMA0").at("rate").at("verdict"), "holds");

  const std::string text = list(system).out;
  for (const char* wanted :
       {"FT232H", "FT232R", "driver uart-pl011", "cannot: makes 2000000 bit/s (-20.00 %)", "2341:0043 'Uno'",
        "by-id/usb-FTGOOD", "latency timer", "USB full speed"})
    EXPECT_NE(text.find(wanted), std::string::npos) << wanted << "\n" << text;
}

TEST(List, SaysWhoHasThePortAndWhoMayNot) {
  FakeSysfs system;
  system.add_uart("ttyS1", "serial8250", 40'000'000);
  const int fd = ::open(system.dev("ttyS1").c_str(), O_RDWR | O_CLOEXEC);
  ASSERT_GE(fd, 0);
  const auto row = [&] { return Json::parse(list(system, {"--json"}).lines().at(0)); };
  Json port = row();
  EXPECT_EQ(port.at("access"), "in_use");
  ASSERT_EQ(port.at("users").size(), 1U) << port;
  EXPECT_EQ(port.at("users")[0].at("pid"), ::getpid());
  EXPECT_NE(list(system).out.find("in use by tm485_tests"), std::string::npos) << list(system).out;
  ::close(fd);
  EXPECT_EQ(row().at("access"), "free");
  std::filesystem::remove(system.dev("ttyS1"));
  EXPECT_EQ(row().at("access"), "no_device_node");
}

TEST(List, TheKernelsConsoleIsNamed) {
  FakeSysfs system;
  system.add_uart("ttyAMA0", "uart-pl011", 48'000'000);
  system.set_attribute("ttyAMA0", "console", "N");
  EXPECT_EQ(list(system).out.find("console="), std::string::npos);
  system.set_attribute("ttyAMA0", "console", "Y");
  EXPECT_EQ(Json::parse(list(system, {"--json"}).lines().at(0)).at("access"), "console");
  EXPECT_NE(list(system).out.find("console=ttyAMA0"), std::string::npos) << list(system).out;
}

TEST(Bench, OutlivesAPortThatGoesAndComesBack) {
  const TemporaryFolder folder;
  auto simulator = std::make_unique<Simulator>(Process::Arguments{"--link", folder.path("replug")});
  Process bench({"bench", simulator->port(), "--seconds", "6", "--period", "2ms", "--json"});
  std::this_thread::sleep_for(std::chrono::milliseconds(1500));
  EXPECT_EQ(simulator->stop().exit_code, 0);
  simulator = std::make_unique<Simulator>(Process::Arguments{"--link", folder.path("replug")});
  const Finished finished = bench.wait();
  EXPECT_EQ(finished.exit_code, 0) << finished.err;
  EXPECT_NE(finished.err.find("tm485: port_gone:"), std::string::npos) << finished.err;
  EXPECT_NE(finished.err.find("tm485: port_back:"), std::string::npos) << finished.err;
  const Json result = Json::parse(finished.lines().at(0));
  EXPECT_EQ(result.at("port_returns"), 1);
  EXPECT_GT(result.at("good").get<int>(), 0);
}

TEST(Bench, APortThatStaysGoneIsAFailure) {
  const TemporaryFolder folder;
  Simulator simulator({"--link", folder.path("gone")});
  Process bench({"bench", simulator.port(), "--seconds", "4", "--period", "2ms"});
  std::this_thread::sleep_for(std::chrono::milliseconds(1500));
  EXPECT_EQ(simulator.stop().exit_code, 0);
  const Finished finished = bench.wait();
  EXPECT_EQ(finished.exit_code, 1) << finished.err;
  EXPECT_FALSE(finished.timed_out);
  EXPECT_NE(finished.err.find("tm485: port_gone:"), std::string::npos) << finished.err;
}

}  // namespace
}  // namespace tm485::test
