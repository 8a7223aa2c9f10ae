// tm485_vm_gpio_line DIRECTION SEEN COUNT: requests the line of a direction (gpio:CHIP:LINE[:low]), switches it COUNT
// times and compares each with what is seen elsewhere (seen_level.hpp). Exit code 1 if a level differs.
#include <cerrno>
#include <cstdio>
#include <cstdlib>

#include "seen_level.hpp"
#include "tm485/linux/gpio_line.hpp"
#include "tm485/linux/rs485_direction.hpp"

namespace {

using tm485::linux_hal::GpioAddress;
using tm485::linux_hal::GpioLine;

int fail(const tm485::linux_hal::OsError& error) {
  std::printf("%s: %s\n", error.what.c_str(), error.remedy.c_str());
  return 1;
}

bool same(const char* when, bool active_low, bool active, int seen) {
  const int wanted = active != active_low ? 1 : 0;
  if (seen != wanted) std::printf("%s: %d wanted, %d seen\n", when, wanted, seen);
  return seen == wanted;
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 4) return 2;
  const auto direction = tm485::linux_hal::parse_direction(arguments[1]);
  if (!direction) return fail(direction.error());
  const GpioAddress& address = direction->gpio;
  const tm485::vm::SeenLevel seen(arguments[2]);
  const int times = std::atoi(arguments[3]);

  auto line = GpioLine::open(address);
  if (!line) return fail(line.error());
  if (!same("after the request", address.active_low, false, seen.level())) return 1;
  for (int i = 0; i < times; ++i) {
    const bool active = i % 2 == 0;
    if (const int error_number = line->set(active); error_number != 0) {
      std::printf("set: errno %d\n", error_number);
      return 1;
    }
    if (!same("after set()", address.active_low, active, seen.level())) return 1;
  }
  const auto second = GpioLine::open(address);
  if (second || second.error().error_number != EBUSY) {
    std::printf("a line in use is given away again, or refused for another reason\n");
    return 1;
  }
  std::printf("%s: %d levels of %s, and the refusal of a second request: %s\n",
              tm485::linux_hal::gpio_library().c_str(), times, line->description().c_str(),
              second.error().what.c_str());
  return times > 0 ? 0 : 1;
}
