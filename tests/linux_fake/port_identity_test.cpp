// Chips and ports recognised by what a system shows of them.
#include "tm485/linux/port_identity.hpp"

#include <gmock/gmock.h>

#include "support/fake_sysfs.hpp"
#include "tm485/linux/serial_chips.hpp"

namespace tm485::linux_hal {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using test::FakeSysfs;
using ::testing::HasSubstr;

SystemPaths paths(const FakeSysfs& system) { return {system.sys(), system.dev()}; }

struct Expected {
  const char *vendor, *product, *release, *driver, *chip;
  RateVerdict verdict;
  std::uint32_t nearest;
};

class UsbChipTest : public ::testing::TestWithParam<Expected> {};

// Written down from the evidence, not from the table.
INSTANTIATE_TEST_SUITE_P(
    All, UsbChipTest,
    ::testing::Values(Expected{"0403", "6001", "0600", "ftdi_sio", "FT232R", RateVerdict::cannot, 2'000'000},
                      Expected{"0403", "6001", "0400", "ftdi_sio", "FT232B", RateVerdict::cannot, 2'000'000},
                      Expected{"0403", "6010", "0500", "ftdi_sio", "FT2232D", RateVerdict::cannot, 2'000'000},
                      Expected{"0403", "6010", "0700", "ftdi_sio", "FT2232H", RateVerdict::holds, 2'526'316},
                      Expected{"0403", "6011", "0800", "ftdi_sio", "FT4232H", RateVerdict::holds, 2'526'316},
                      Expected{"0403", "6014", "0900", "ftdi_sio", "FT232H", RateVerdict::holds, 2'526'316},
                      Expected{"0403", "6015", "1000", "ftdi_sio", "FT-X", RateVerdict::cannot, 2'000'000},
                      Expected{"1a86", "7523", "0264", "ch341", "CH340", RateVerdict::cannot, 2'000'000},
                      Expected{"1a86", "55d3", "0445", "cdc_acm", "CH343", RateVerdict::holds, 2'500'000},
                      Expected{"10c4", "ea60", "0100", "cp210x", "CP2102N", RateVerdict::cannot, 2'400'000},
                      Expected{"10c4", "ea70", "0100", "cp210x", "CP2105", RateVerdict::cannot, 2'000'000},
                      Expected{"04d8", "00dd", "0100", "cdc_acm", "MCP2221", RateVerdict::cannot, 460'800},
                      Expected{"04e2", "1420", "0003", "xr_serial", "XR21B1420", RateVerdict::holds,
                               2'500'000},
                      Expected{"2341", "0043", "0001", "cdc_acm", "", RateVerdict::unknown, 0}));

TEST_P(UsbChipTest, IsRecognisedWithWhatItMakesOfTheRate) {
  const Expected& expected = GetParam();
  FakeSysfs system;
  system.add_usb("ttyUSB0", {expected.vendor, expected.product, expected.release, expected.driver});
  const PortIdentity port = identify_port(system.dev("ttyUSB0"), paths(system));
  EXPECT_THAT(port.chip, HasSubstr(expected.chip));
  EXPECT_EQ(port.chip.empty(), std::string_view(expected.chip).empty());
  EXPECT_EQ(port.driver, expected.driver);
  EXPECT_EQ(port.bus, PortBus::usb);
  const RateAbility ability = rate_ability(port, 2'500'000);
  EXPECT_EQ(ability.verdict, expected.verdict);
  EXPECT_EQ(ability.nearest, expected.nearest);
  EXPECT_EQ(rate_ability(port, 115'200).verdict, RateVerdict::unknown) << "the row speaks of 2.5 Mbit/s";
}

TEST(UsbChips, EveryRowHasItsTextsAndAVerdictThatItsRateBears) {
  for (const UsbChip& chip : usb_chips()) {
    EXPECT_FALSE(chip.name.empty());
    EXPECT_FALSE(chip.remark.empty()) << chip.name;
    EXPECT_FALSE(chip.source.empty()) << chip.name;
    EXPECT_LE(chip.first_release, chip.last_release) << chip.name;
    EXPECT_EQ(rate_acceptable(kTm485Rate, chip.nearest_rate), chip.verdict == RateVerdict::holds)
        << chip.name;
    EXPECT_EQ(find_usb_chip(chip.vendor, chip.product, chip.first_release), &chip) << "hidden: " << chip.name;
  }
}

TEST(NearestRate, IsThatOfTheEvidence) {
  const auto rate = [](ClockDivider divider, std::uint32_t clock) {
    return nearest_rate(divider, clock, 2'500'000).value_or(1);
  };
  EXPECT_EQ(rate(ClockDivider::whole_16, 1'843'200), 115'200U);
  EXPECT_EQ(rate(ClockDivider::whole_16, 14'745'600), 921'600U);
  EXPECT_EQ(rate(ClockDivider::whole_16, 48'000'000), 3'000'000U) << "its driver reports 2500000";
  EXPECT_EQ(rate(ClockDivider::whole_16, 40'000'000), 2'500'000U);
  EXPECT_EQ(rate(ClockDivider::pl011, 24'000'000), 1'500'000U);
  EXPECT_NEAR(rate(ClockDivider::pl011, 48'000'000), 2'493'506, 1);
  EXPECT_EQ(rate(ClockDivider::pl011, 50'000'000), 2'500'000U);
  EXPECT_EQ(rate(ClockDivider::omap, 48'000'000), 3'000'000U);
  EXPECT_EQ(rate(ClockDivider::omap, 160'000'000), 2'500'000U);
  EXPECT_NEAR(rate(ClockDivider::omap, 192'000'000), 2'461'538, 1);
  EXPECT_EQ(rate(ClockDivider::exar, 125'000'000), 2'500'000U);
  EXPECT_NEAR(rate(ClockDivider::whole_8, 64'000'000), 2'461'538, 1);
  EXPECT_EQ(rate(ClockDivider::whole_8, 100'000'000), 2'500'000U);
  EXPECT_EQ(rate(ClockDivider::imx, 24'000'000), 1'500'000U);
  EXPECT_EQ(rate(ClockDivider::imx, 80'000'000), 2'500'000U);
  EXPECT_FALSE(nearest_rate(ClockDivider::unknown, 48'000'000, 2'500'000));
  EXPECT_FALSE(nearest_rate(ClockDivider::pl011, 0, 2'500'000));
  EXPECT_FALSE(nearest_rate(ClockDivider::pl011, 48'000'000, 0));
}

TEST(PortIdentity, AUartOfTheBoardIsNamedByTheDriverBehindTheSerialCore) {
  FakeSysfs system;
  system.add_uart("ttyAMA0", "uart-pl011", 48'000'000);
  system.add_uart("ttyS0", "serial8250", 1'843'200);
  const PortIdentity pl011 = identify_port(system.dev("ttyAMA0"), paths(system));
  EXPECT_EQ(pl011.driver, "uart-pl011");
  EXPECT_EQ(pl011.chip, "PL011");
  EXPECT_EQ(pl011.bus, PortBus::board);
  EXPECT_EQ(rate_ability(pl011, 2'500'000).verdict, RateVerdict::holds);
  const PortIdentity slow = identify_port(system.dev("ttyS0"), paths(system));
  EXPECT_EQ(rate_ability(slow, 2'500'000).verdict, RateVerdict::cannot);
  EXPECT_EQ(rate_ability(slow, 2'500'000).nearest, 115'200U);
  EXPECT_EQ(rate_ability(slow, 115'200).verdict, RateVerdict::holds);
}

TEST(PortIdentity, TheStableNameAndTheLinkLeadToTheSameDevice) {
  FakeSysfs system;
  system.add_usb("ttyUSB3", {"0403", "6014", "0900", "ftdi_sio", "480", "FTXYZ", "C232HM", "16"});
  for (const std::string& path : {system.dev("ttyUSB3"), system.by_id("FTXYZ")}) {
    const PortIdentity port = identify_port(path, paths(system));
    EXPECT_EQ(port.path, system.dev("ttyUSB3"));
    EXPECT_EQ(port.stable_path, system.by_id("FTXYZ"));
    EXPECT_EQ(port.name, "ttyUSB3");
    EXPECT_EQ(port.serial_number, "FTXYZ");
    EXPECT_EQ(port.product_text, "C232HM");
    EXPECT_EQ(port.latency_timer_ms, 16U);
    EXPECT_EQ(port.usb_mbit, 480U);
  }
}

TEST(PortIdentity, WhatIsNotThereStaysUnknown) {
  FakeSysfs system;
  const PortIdentity port = identify_port(system.dev("ttyUSB9"), paths(system));
  EXPECT_EQ(port.path, system.dev("ttyUSB9"));
  EXPECT_EQ(port.bus, PortBus::unknown);
  EXPECT_TRUE(port.driver.empty() && port.chip.empty() && port.stable_path.empty());
  EXPECT_EQ(rate_ability(port, 2'500'000).verdict, RateVerdict::unknown);
  EXPECT_EQ(identify_port("/dev/pts/99", paths(system)).bus, PortBus::pseudo_terminal);
}

TEST(ListPorts, HoldsWhatHasADeviceInTheOrderOfTheNumbers) {
  FakeSysfs system;
  EXPECT_TRUE(list_ports(paths(system)).empty());
  EXPECT_TRUE(list_ports({"/nonexistent", "/nonexistent"}).empty());
  system.add_console("tty1");
  system.add_uart("ttyS0", "serial8250", 1'843'200);
  system.add_uart("ttyS1", "serial8250", 1'843'200, "0");
  system.add_usb("ttyUSB10", {"0403", "6014", "0900", "ftdi_sio", "480", "B"});
  system.add_usb("ttyUSB2", {"1a86", "7523", "0264", "ch341", "12", "C"});
  std::vector<std::string> names;
  for (const PortIdentity& port : list_ports(paths(system))) names.push_back(port.name);
  EXPECT_EQ(names, (std::vector<std::string>{"ttyS0", "ttyUSB2", "ttyUSB10"}));
}

TEST(PortLimits, FollowTheWayOfACharacter) {
  PortIdentity port;
  port.bus = PortBus::usb;
  port.usb_mbit = 480;
  EXPECT_EQ(port_limits(port, 2'500'000).shortest_exchange, microseconds(250));
  EXPECT_TRUE(port_limits(port, 2'500'000).best_effort);
  port.usb_mbit = 12;
  EXPECT_EQ(port_limits(port, 2'500'000).shortest_exchange, milliseconds(1));
  port.usb_mbit = 480;
  port.latency_timer_ms = 16;
  EXPECT_EQ(port_limits(port, 2'500'000).shortest_exchange, milliseconds(16));
  EXPECT_EQ(port_limits(port, 2'500'000).latency_allowance, milliseconds(36));
  port = {};
  port.bus = PortBus::board;
  port.timeout_bits = 32;  // 48 + 3 + 12.8 + 15 + 20
  EXPECT_EQ(port_limits(port, 2'500'000).shortest_exchange, Time{98'800});
  port.timeout_bits = 40;
  EXPECT_EQ(port_limits(port, 2'500'000).shortest_exchange, Time{102'000});
  EXPECT_FALSE(port_limits(port, 2'500'000).best_effort);
  port.bus = PortBus::pseudo_terminal;
  EXPECT_EQ(port_limits(port, 2'500'000).shortest_exchange, Time{0});
}

}  // namespace
}  // namespace tm485::linux_hal
