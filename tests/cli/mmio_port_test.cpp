// The text form of a memory-mapped UART, and the command on a file that stands for physical memory.
#include <gmock/gmock.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>

#include "any_port.hpp"
#include "mmio_text.hpp"
#include "process.hpp"

namespace tm485::test {
namespace {

using cli::parse_mmio;
using linux_hal::MmioBlock;
using linux_hal::MmioDirection;
using ::testing::HasSubstr;

TEST(MmioText, WhatIsSaidIsTaken) {
  const auto pl011 = parse_mmio("pl011@0x9000000,clock=48MHz");
  ASSERT_TRUE(pl011) << pl011.error();
  EXPECT_EQ(pl011->block, MmioBlock::pl011);
  EXPECT_EQ(pl011->address, 0x9000000U);
  EXPECT_EQ(pl011->clock_hz, 48'000'000U);
  EXPECT_EQ(pl011->memory, "/dev/mem");
  EXPECT_EQ(pl011->direction.kind, MmioDirection::Kind::automatic);

  const auto other = parse_mmio(
      "16550@4261498944,clock=500000000,shift=2,width=1,direction=rts_off,lead=1us,release=2us,allowance="
      "20ms");
  ASSERT_TRUE(other) << other.error();
  EXPECT_EQ(other->block, MmioBlock::ns16550);
  EXPECT_EQ(other->address, 0xFE015040U);
  EXPECT_EQ(other->clock_hz, 500'000'000U);
  EXPECT_EQ(other->layout.shift, 2);
  EXPECT_EQ(other->layout.width, 1);
  EXPECT_EQ(other->direction.kind, MmioDirection::Kind::rts_off);
  EXPECT_EQ(other->driver_lead, Time{1'000});
  EXPECT_EQ(other->release_bound, Time{2'000});
  EXPECT_EQ(other->latency_allowance, Time{20'000'000});

  const auto uio = parse_mmio("pl011,clock=48MHz,uio=/dev/uio0");
  ASSERT_TRUE(uio) << uio.error();
  EXPECT_EQ(uio->address, 0U);
  EXPECT_EQ(uio->uio, "/dev/uio0");
}

TEST(MmioText, WordsApartAreReadAsWords) {
  EXPECT_EQ(parse_mmio("16550@0x1000,clock=40MHz")->layout.width, 1);
  EXPECT_EQ(parse_mmio("16550@0x1000,clock=40MHz,shift=1")->layout.width, 2);
  EXPECT_EQ(parse_mmio("16550@0x1000,clock=40MHz,shift=2")->layout.width, 4);
}

TEST(MmioText, WhatIsWrongIsNamed) {
  const auto error = [](std::string_view text) {
    const auto parsed = parse_mmio(text);
    return parsed ? std::string("taken") : parsed.error();
  };
  EXPECT_THAT(error(""), HasSubstr("no kind of UART"));
  EXPECT_THAT(error("imx@0x1000,clock=1MHz"), HasSubstr("'imx' is no kind of UART"));
  EXPECT_THAT(error("pl011@,clock=48MHz"), HasSubstr("no address"));
  EXPECT_THAT(error("pl011@0,clock=48MHz"), HasSubstr("no address"));
  EXPECT_THAT(error("pl011@0x12345678901234567,clock=48MHz"), HasSubstr("no address"));
  EXPECT_THAT(error("pl011@0x9000000x,clock=48MHz"), HasSubstr("no address"));
  EXPECT_THAT(error("pl011@0x1000"), HasSubstr("clock is needed"));
  EXPECT_THAT(error("pl011,clock=48MHz"), HasSubstr("address"));
  EXPECT_THAT(error("pl011@0x1000,clock=fast"), HasSubstr("clock: "));
  EXPECT_THAT(error("pl011@0x1000,clock=48MHz,shift=3"), HasSubstr("shift"));
  EXPECT_THAT(error("16550@0x1000,clock=48MHz,shift=9"), HasSubstr("shift=9"));
  EXPECT_THAT(error("16550@0x1000,clock=48MHz,width=4"), HasSubstr("width"));
  EXPECT_THAT(error("pl011@0x1000,clock=48MHz,uio="), HasSubstr("uio"));
  EXPECT_THAT(error("pl011@0x1000,clock=48MHz,direction=gpio"), HasSubstr("direction=gpio"));
  EXPECT_THAT(error("pl011@0x1000,clock=48MHz,lead=1"), HasSubstr("lead: "));
  EXPECT_THAT(error("pl011@0x1000,clock=48MHz,speed=1"), HasSubstr("no key 'speed'; there are: clock"));
  EXPECT_THAT(error("pl011@0x1000,,clock=48MHz"), HasSubstr("no key ''"));
}

/// Two pages of "memory"; in the second a PL011 that never gets a byte: its registers keep what is written to them, and
/// FR says that both FIFOs are empty.
std::string silent_pl011(const TemporaryFolder& folder) {
  const std::string path = folder.path("memory");
  std::ofstream file(path, std::ios::binary);
  std::string memory(8192, '\0');
  memory[0x1018] = '\x90';
  file << memory;
  return path;
}

TEST(MmioPort, ASilentUartIsATimeout) {
  const TemporaryFolder folder;
  const Finished silent = run({"info", "mmio:pl011@0x1000,clock=48MHz,memory=" + silent_pl011(folder)});
  EXPECT_EQ(silent.exit_code, 1);
  EXPECT_THAT(silent.err, HasSubstr("tm485: timeout:"));
  EXPECT_THAT(silent.err, HasSubstr("remedy:"));
}

TEST(MmioPort, WhatCannotBeOpenedIsNamed) {
  const TemporaryFolder folder;
  const Finished rate = run({"info", "mmio:pl011@0x1000,clock=24MHz,memory=" + silent_pl011(folder)});
  EXPECT_EQ(rate.exit_code, 1);
  EXPECT_THAT(rate.err, HasSubstr("tm485: open_failed:"));
  EXPECT_THAT(rate.err, HasSubstr("1500000 bit/s"));
  EXPECT_THAT(rate.err, HasSubstr("remedy: raise the UART's clock"));
  const Finished absent = run({"info", "mmio:pl011@0x1000,clock=48MHz,memory=" + folder.path("absent")});
  EXPECT_EQ(absent.exit_code, 1);
  EXPECT_THAT(absent.err, HasSubstr("tm485: port_gone:"));
  const Finished outside = run({"info", "mmio:pl011@0x100000,clock=48MHz,memory=" + silent_pl011(folder)});
  EXPECT_EQ(outside.exit_code, 1);
  EXPECT_THAT(outside.err, HasSubstr("remedy: nothing answers at this address"));
  const Finished text = run({"info", "mmio:uart"});
  EXPECT_EQ(text.exit_code, 2);
  EXPECT_THAT(text.err, HasSubstr("tm485: bad_port:"));
  EXPECT_THAT(text.err, HasSubstr("mmio:pl011@ADDRESS"));
}

TEST(MmioPort, AUartThatWasGoneIsOpenedAgainByTheSameProgram) {
  const TemporaryFolder folder;
  const std::string memory = silent_pl011(folder);
  const auto answer = [&memory](const char* flags) {
    std::fstream file(memory, std::ios::binary | std::ios::in | std::ios::out);
    file.seekp(0x1018);
    file.write(flags, 4);
  };
  auto port = cli::AnyPort::open("mmio:pl011@0x1000,clock=48MHz,memory=" + memory, {});
  ASSERT_TRUE(port) << port.error().cause;
  answer("\xFF\xFF\xFF\xFF");  // as a bus on which nobody answers any more
  std::array<std::uint8_t, 4> buffer{0x1A};
  ASSERT_EQ(port->try_receive(buffer, Time{0}).fault, Errc::port_gone);
  EXPECT_TRUE(port->gone());
  std::filesystem::rename(memory, memory + ".away");
  EXPECT_FALSE(port->reopen());
  EXPECT_TRUE(port->gone());
  EXPECT_EQ(port->try_send(buffer, Time{0}), std::unexpected(Errc::port_gone));
  std::filesystem::rename(memory + ".away", memory);
  answer("\x90\x00\x00\x00");
  const auto opened = port->reopen();
  ASSERT_TRUE(opened) << opened.error().cause;
  EXPECT_FALSE(port->gone());
  EXPECT_TRUE(port->try_send(buffer, Time{0}));
}

TEST(MmioDirection, IsAGpioLineOrRtsAndNotTheKernels) {
  const auto error = [](const char* port, const char* direction) {
    const Finished finished = run({"info", port, "--direction", direction});
    EXPECT_NE(finished.exit_code, 0);
    return finished.err;
  };
  EXPECT_THAT(error("mmio:pl011@0x9000000,clock=48MHz", "kernel"), HasSubstr("bad_direction"));
  EXPECT_THAT(error("mmio:pl011@0x9000000,clock=48MHz,direction=rts", "gpio:gpiochip0:3"),
              HasSubstr("both name a direction"));
  // The line is asked for before the UART is touched.
  EXPECT_THAT(error("mmio:pl011@0x9000000,clock=48MHz", "gpio:nosuchchip:3"), HasSubstr("gpio"));
}

}  // namespace
}  // namespace tm485::test
