// The text form of a direction control, and what is said about one that is too slow.
#include <gmock/gmock.h>

#include <string>
#include <utility>

#include "tm485/linux/rs485_direction.hpp"

namespace tm485::linux_hal {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(DirectionText, ReadsEveryForm) {
  const auto kernel = parse_direction("kernel:low:mute");
  ASSERT_TRUE(kernel);
  EXPECT_EQ(kernel->kind, DirectionKind::kernel);
  EXPECT_TRUE(kernel->rts_low);
  EXPECT_TRUE(kernel->mute);
  const auto offset = parse_direction("gpio:/dev/gpiochip0:17:low");
  ASSERT_TRUE(offset);
  EXPECT_EQ(offset->kind, DirectionKind::gpio);
  EXPECT_EQ(offset->gpio.chip, "/dev/gpiochip0");
  EXPECT_EQ(offset->gpio.line, "17");
  EXPECT_TRUE(offset->gpio.active_low);
  const auto name = parse_direction("gpio:DE");
  ASSERT_TRUE(name);
  EXPECT_EQ(name->gpio.chip, "");
  EXPECT_EQ(name->gpio.line, "DE");
  EXPECT_FALSE(name->gpio.active_low);
}

TEST(DirectionText, WritesWhatItReads) {
  for (const std::string text : {"auto", "kernel", "kernel:low", "kernel:mute", "kernel:low:mute", "gpio:DE",
                                 "gpio:DE:low", "gpio:0:17", "gpio:gpiochip4:RTS0:low", "gpio:low:low"}) {
    const auto config = parse_direction(text);
    ASSERT_TRUE(config) << text;
    EXPECT_EQ(to_text(*config), text);
  }
}

TEST(DirectionText, SaysWhatIsWrongAndWhatCouldBeWritten) {
  for (const auto& [text, why] : std::initializer_list<std::pair<std::string, std::string>>{
           {"", "it is empty"},
           {"rts", "no such direction control"},
           {"auto:low", "no such direction control"},
           {"kernel:high", "'high' is neither low nor mute"},
           {"kernel:", "'' is neither low nor mute"},
           {"kernel:low:low", "'low' comes twice"},
           {"gpio", "names no line"},
           {"gpio:", "a part of it is empty"},
           {"gpio::3", "a part of it is empty"},
           {"gpio:0:", "a part of it is empty"},
           {"gpio:17", "of which chip"},
           {"gpio:17:low", "of which chip"},
           {"gpio:0:1:2", "too many parts"},
           {"gpio:0:1:2:low", "too many parts"}}) {
    const auto config = parse_direction(text);
    ASSERT_FALSE(config) << text;
    EXPECT_EQ(config.error().code, Errc::bad_argument);
    EXPECT_THAT(config.error().what, HasSubstr("'" + text + "'"));
    EXPECT_THAT(config.error().what, HasSubstr(why));
    EXPECT_THAT(config.error().remedy, HasSubstr("gpio:CHIP:LINE"));
  }
}

TEST(DirectionWarning, IsForSoftwareOnly) {
  EXPECT_EQ(direction_warning(DirectionKind::automatic, {}), std::nullopt);
  EXPECT_EQ(direction_warning(DirectionKind::kernel, release_of_driver("stm32-usart")), std::nullopt);
  for (const std::string driver : {"uart-pl011", "imx-uart", "something-new", ""}) {
    const auto warning = direction_warning(DirectionKind::kernel, release_of_driver(driver));
    ASSERT_TRUE(warning) << driver;
    EXPECT_THAT(*warning, HasSubstr("best effort"));
    EXPECT_THAT(*warning, HasSubstr("no time below 2.8 us is promised"));
    EXPECT_THAT(*warning, HasSubstr("--direction auto"));
    EXPECT_THAT(*warning, Not(HasSubstr("--direction kernel")));
  }
}

TEST(DirectionWarning, NamesWhatWasMeasured) {
  const ReleaseBound program{Time{100'000}, false, "a program"};
  const auto warning = direction_warning(DirectionKind::gpio, program, Time{12'345});
  ASSERT_TRUE(warning);
  EXPECT_THAT(*warning, HasSubstr("up to 12.3 us late in this run"));
  EXPECT_THAT(*warning, HasSubstr("--direction kernel"));
  const auto in_time = direction_warning(DirectionKind::gpio, program, Time{2'800});
  ASSERT_TRUE(in_time) << "a good run is no promise";
  EXPECT_THAT(*in_time, HasSubstr("no time below"));
}

TEST(DirectionWarning, AHardwareThatIsMeasuredLateIsWarnedOf) {
  EXPECT_TRUE(direction_warning(DirectionKind::kernel, release_of_driver("stm32-usart"), Time{2'801}));
  EXPECT_FALSE(direction_warning(DirectionKind::kernel, release_of_driver("stm32-usart"), Time{2'800}));
}

}  // namespace
}  // namespace tm485::linux_hal
