// GpioLine in a build without libgpiod: it says what to install, whatever line is asked for.
#include "tm485/linux/gpio_line.hpp"

#include <gmock/gmock.h>

#include <cerrno>

namespace tm485::linux_hal {
namespace {

using ::testing::HasSubstr;

TEST(GpioLineWithoutLibrary, SaysWhatToInstall) {
  EXPECT_EQ(gpio_library(), "");
  for (const GpioAddress& address : {GpioAddress{"gpiochip0", "3", false}, GpioAddress{"", "DE", true},
                                     GpioAddress{"label", "x", false}}) {
    const auto line = GpioLine::open(address);
    ASSERT_FALSE(line);
    EXPECT_EQ(line.error().code, Errc::bad_argument);
    EXPECT_EQ(line.error().error_number, ENOSYS);
    EXPECT_THAT(line.error().remedy, HasSubstr("install libgpiod-dev and build again"));
  }
}

}  // namespace
}  // namespace tm485::linux_hal
