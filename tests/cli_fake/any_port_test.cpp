// The ports of the command's texts, and the doctor, on adapters of a fake kernel: refused, directed, pulled out, put back.
#include "any_port.hpp"

#include <gmock/gmock.h>
#include <linux/serial.h>

#include <array>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "commands.hpp"
#include "direction_view.hpp"
#include "linux_fake/fake_kernel.hpp"
#include "linux_fake/fake_tty.hpp"
#include "support/fake_sysfs.hpp"
#include "support/frames.hpp"

namespace tm485::cli {
namespace {

using linux_hal::fake::FakeKernel;
using linux_hal::fake::FakeTty;
using test::FakeSysfs;
using ::testing::Contains;
using ::testing::Field;
using ::testing::HasSubstr;

constexpr std::array<std::uint8_t, 1> kId3Request{0x1A};

/// An adapter with a chip of FTDI that drives RS-485 by itself, named after its product id: 6014 (FT232H) makes
/// 2.5 Mbit/s, 6001 at full speed (FT232R) does not.
class AnyPortOnAdapter : public ::testing::Test {
 protected:
  ~AnyPortOnAdapter() override {
    port_.reset();
    EXPECT_EQ(kernel_.open_descriptors(), 0U) << "a descriptor leaks";
  }

  FakeTty& plug_in(const std::string& product = "6014", const std::string& latency_timer = "1") {
    const bool fast = product == "6014";
    system_.add_usb("ttyUSB0", {"0403", product, fast ? "0900" : "0600", "ftdi_sio", fast ? "480" : "12",
                                "MINE", "adapter", latency_timer});
    ttys_.push_back(std::make_unique<FakeTty>());
    tty().has_rs485 = true;
    tty().responder = [](const std::vector<std::uint8_t>& request) -> std::vector<std::uint8_t> {
      if (request.at(0) == 0x92) return test::id2_reply(0x11);
      if (request.at(0) == 0x1A) return test::id3_reply(1'000, 2);
      return {};
    };
    kernel_.add(path(), tty());
    return tty();
  }
  void pull_out() {
    tty().unplug();
    kernel_.remove(path());
    system_.remove("ttyUSB0", "MINE");
  }
  FakeTty& tty() { return *ttys_.back(); }
  [[nodiscard]] std::string path() const { return system_.dev("ttyUSB0"); }
  [[nodiscard]] AnyPortOptions options() const {
    AnyPortOptions options;
    options.system = {system_.sys(), system_.dev()};
    return options;
  }
  void open(const AnyPortOptions& options) {
    auto port = AnyPort::open(path(), options);
    ASSERT_TRUE(port) << port.error().cause;
    port_.emplace(std::move(*port));
  }

  FakeSysfs system_;
  FakeKernel kernel_;
  std::vector<std::unique_ptr<FakeTty>> ttys_;
  std::optional<AnyPort> port_;
};

TEST_F(AnyPortOnAdapter, ADirectedPortComesBackWithItsDirection) {
  plug_in();
  AnyPortOptions kernel_direction = options();
  kernel_direction.direction = "kernel";
  open(kernel_direction);
  ASSERT_NE(tty().rs485().flags & SER_RS485_ENABLED, 0U);
  pull_out();
  std::array<std::uint8_t, 16> buffer{};
  ASSERT_EQ(port_->try_receive(buffer, Time{0}).fault, Errc::port_gone);
  EXPECT_TRUE(port_->gone());
  const auto absent = port_->reopen();
  ASSERT_FALSE(absent);
  EXPECT_EQ(absent.error().name, "port_gone");
  EXPECT_TRUE(port_->gone());
  plug_in();
  ASSERT_TRUE(port_->reopen());
  EXPECT_FALSE(port_->gone());
  EXPECT_NE(tty().rs485().flags & SER_RS485_ENABLED, 0U) << "or its driver never leaves the line";
  EXPECT_TRUE(port_->try_send(kId3Request, Time{0}));
}

TEST_F(AnyPortOnAdapter, ADirectedPortRefusesASlowerDeviceInItsPlace) {
  plug_in();
  AnyPortOptions kernel_direction = options();
  kernel_direction.direction = "kernel";
  open(kernel_direction);
  pull_out();
  plug_in("6014", "16");
  kernel_.fail_open(system_.latency_timer("ttyUSB0"), EACCES);
  const auto slower = port_->reopen();
  ASSERT_FALSE(slower);
  EXPECT_EQ(slower.error().name, "another_device");
  EXPECT_TRUE(port_->gone());
  EXPECT_EQ(kernel_.open_descriptors(), 0U);
  EXPECT_EQ(port_->try_send(kId3Request, Time{0}), std::unexpected(Errc::port_gone));
  ASSERT_TRUE(port_->reopen()) << "once the timer can be set";
}

TEST_F(AnyPortOnAdapter, ADirectedPortRefusesADeviceThatCannotSwitch) {
  plug_in();
  AnyPortOptions kernel_direction = options();
  kernel_direction.direction = "kernel";
  open(kernel_direction);
  pull_out();
  plug_in().has_rs485 = false;
  ASSERT_FALSE(port_->reopen());
  EXPECT_TRUE(port_->gone());
  EXPECT_EQ(kernel_.open_descriptors(), 0U);
}

TEST_F(AnyPortOnAdapter, AChipThatCannotMakeTheRateIsOpenedOnlyIfAskedTo) {
  plug_in("6001");
  const auto refused = AnyPort::open(path(), options());
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().name, "chip_unfit");
  EXPECT_EQ(refused.error().exit_code, kExitFailure);
  EXPECT_THAT(refused.error().remedy, HasSubstr("--any-chip"));
  AnyPortOptions any = options();
  any.any_chip = true;
  open(any);
  EXPECT_THAT(port_->warnings(), Contains(Field(&Problem::name, "chip_unfit")));
}

std::string warning_of(const AnyPort& port) {
  testing::internal::CaptureStderr();
  warn_of_direction(port);
  return testing::internal::GetCapturedStderr();
}

TEST_F(AnyPortOnAdapter, WhatADirectionCannotHoldIsSaid) {
  plug_in();
  open(options());
  EXPECT_EQ(warning_of(*port_), "") << "the transceiver switches by itself";
  port_.reset();
  AnyPortOptions kernel_direction = options();
  kernel_direction.direction = "kernel";
  open(kernel_direction);
  EXPECT_THAT(warning_of(*port_), HasSubstr("tm485: warning: "));
}

/// The doctor's findings, by their names.
std::vector<std::string> findings(const DoctorOptions& options) {
  testing::internal::CaptureStdout();
  (void)run_doctor(options);
  const auto report = nlohmann::json::parse(testing::internal::GetCapturedStdout());
  std::vector<std::string> names;
  for (const auto& finding : report.at("findings")) names.push_back(finding.at("name"));
  return names;
}

TEST_F(AnyPortOnAdapter, TheDoctorOpensAnUnfitChipIfAskedTo) {
  plug_in("6001");
  DoctorOptions doctor;
  doctor.port.port = path();
  doctor.port.json = true;
  doctor.port.system = options().system;
  EXPECT_THAT(findings(doctor), testing::ElementsAre("cannot_open"));
  EXPECT_EQ(tty().writes(), 0);
  doctor.port.any_chip = true;
  EXPECT_THAT(findings(doctor), testing::Not(Contains("cannot_open")));
  EXPECT_GT(tty().writes(), 0) << "it has asked the encoder";
}

}  // namespace
}  // namespace tm485::cli
