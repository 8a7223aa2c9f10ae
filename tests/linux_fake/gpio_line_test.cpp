// GpioLine by libgpiod, 1.6 or 2.x, whichever this was built with, against a fake chip.
#include "tm485/linux/gpio_line.hpp"

#include <gmock/gmock.h>

#include <cerrno>

#include "gpio_fixture.hpp"

namespace tm485::linux_hal::fake {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

using GpioLineTest = GpioFixture;

TEST_F(GpioLineTest, IsInactiveFromTheFirstInstantAndAfterItsEnd) {
  {
    auto line = open({"gpiochip0", "3", false});
    ASSERT_TRUE(line) << line.error().message();
    EXPECT_TRUE(chip_.line(3).output);
    EXPECT_EQ(chip_.line(3).consumer, "tm485");
    EXPECT_EQ(line->set(true), 0);
    EXPECT_TRUE(chip_.line(3).high);
  }
  EXPECT_THAT(log_, ElementsAre("line 3 low", "line 3 high", "line 3 low", "line 3 released"));
  EXPECT_FALSE(chip_.line(3).used);
  EXPECT_EQ(kernel_.open_descriptors(), 0U);
}

TEST_F(GpioLineTest, ActiveLowIsHighUntilItIsActive) {
  {
    auto line = open({"gpiochip0", "3", true});
    ASSERT_TRUE(line) << line.error().message();
    EXPECT_THAT(line->description(), HasSubstr("active low"));
    EXPECT_EQ(line->set(true), 0);
    EXPECT_EQ(line->set(false), 0);
    EXPECT_EQ(line->set(true), 0);
  }
  EXPECT_THAT(log_, ElementsAre("line 3 high", "line 3 low", "line 3 high", "line 3 low", "line 3 high",
                                "line 3 released"));
}

TEST_F(GpioLineTest, IsRequestedOnceHoweverOftenItIsSet) {
  auto line = open({"gpiochip0", "3", false});
  ASSERT_TRUE(line);
  const std::uint64_t opened = kernel_.opened();
  for (int i = 0; i < 1000; ++i) ASSERT_EQ(line->set(i % 2 == 0), 0);
  EXPECT_EQ(chip_.line(3).requests, 1);
  EXPECT_EQ(chip_.sets(), 1000);
  EXPECT_EQ(kernel_.opened(), opened);
}

TEST_F(GpioLineTest, IsFoundByPathNameNumberAndLabel) {
  chip_.label = "pinctrl-fake";
  for (const std::string& chip :
       {folder_ + "gpiochip0", std::string("gpiochip0"), std::string("0"), std::string("pinctrl-fake")}) {
    auto line = open({chip, "5", false});
    ASSERT_TRUE(line) << chip << ": " << line.error().message();
    EXPECT_THAT(line->description(), HasSubstr("line 5 of " + folder_ + "gpiochip0"));
  }
  EXPECT_EQ(chip_.line(5).requests, 4);
}

TEST_F(GpioLineTest, IsFoundByItsNameOnAnyChip) {
  other_.line(2).name = "DE";
  auto line = open({"", "DE", false});
  ASSERT_TRUE(line) << line.error().message();
  EXPECT_THAT(line->description(), AllOf(HasSubstr("line 2 (DE)"), HasSubstr("gpiochip1")));
  EXPECT_EQ(other_.line(2).requests, 1);
  EXPECT_EQ(line->set(true), 0);
  EXPECT_TRUE(other_.line(2).high);
}

TEST_F(GpioLineTest, IsFoundByItsNameOnOneChip) {
  chip_.line(1).name = "DE";
  other_.line(2).name = "DE";
  ASSERT_TRUE(open({"gpiochip1", "DE", false}));
  EXPECT_EQ(other_.line(2).requests, 1);
  expect_error({"", "DE", false}, Errc::bad_argument, EINVAL, "more than one line", "by chip and offset");
}

TEST_F(GpioLineTest, ANameThatNoLineHasIsSaid) {
  expect_error({"", "DE", false}, Errc::bad_argument, EINVAL, "no line has the name 'DE'", "gpioinfo");
  expect_error({"0", "DE", false}, Errc::bad_argument, EINVAL, "no line has the name 'DE'", "gpioinfo");
  expect_error({"pinctrl", "1", false}, Errc::bad_argument, EINVAL, "no chip has this label", "gpiodetect");
  expect_error({"0", "", false}, Errc::bad_argument, EINVAL, "no line is named", "name one");
}

TEST_F(GpioLineTest, AChipThatIsNotThereIsPortGone) {
  expect_error({"7", "1", false}, Errc::port_gone, ENOENT, "gpiochip7", "gpiodetect");
}

TEST_F(GpioLineTest, AFileThatIsNoChipIsRefused) {
  const auto line = open({"/dev/null", "1", false});
  ASSERT_FALSE(line);
  // libgpiod 1.6 and 2.x have errno values of their own for it.
  EXPECT_TRUE(line.error().error_number == ENOTTY || line.error().error_number == ENODEV);
  EXPECT_THAT(line.error().what, HasSubstr("/dev/null"));
  EXPECT_THAT(line.error().remedy, HasSubstr("no GPIO chip"));
}

TEST_F(GpioLineTest, AChipWithoutTheLineSaysHowManyItHas) {
  expect_error({"0", "8", false}, Errc::bad_argument, EINVAL, "it has 8 lines and no line 8", "from 0");
  EXPECT_TRUE(open({"0", "7", false}));
}

TEST_F(GpioLineTest, ALineInUseNamesItsUser) {
  chip_.line(3).used = true;
  chip_.line(3).consumer = "spi0 CS1";
  expect_error({"0", "3", false}, Errc::bad_argument, EBUSY, "used by 'spi0 CS1'", "one program at a time");
  chip_.line(3).consumer.clear();
  expect_error({"0", "3", false}, Errc::bad_argument, EBUSY, "without a name", "one program at a time");
}

TEST_F(GpioLineTest, TheSameLineTwiceIsInUseByThisProgram) {
  const auto first = open({"0", "3", false});
  ASSERT_TRUE(first);
  const auto second = open({"0", "3", false});
  ASSERT_FALSE(second);
  EXPECT_THAT(second.error().what, HasSubstr("used by 'tm485'"));
}

TEST_F(GpioLineTest, NoPermissionSaysWhichGroup) {
  kernel_.fail_open(folder_ + "gpiochip0", EACCES);
  expect_error({"0", "3", false}, Errc::bad_argument, EACCES, "Permission denied", "gpio");
}

TEST_F(GpioLineTest, NoPermissionForAnyChipIsNotANameThatIsMissing) {
  kernel_.fail_open(folder_ + "gpiochip0", EACCES);
  kernel_.fail_open(folder_ + "gpiochip1", EACCES);
  expect_error({"", "DE", false}, Errc::bad_argument, EACCES, "Permission denied", "gpio");
}

TEST_F(GpioLineTest, ALineThatIsNoOutputIsRefused) {
  chip_.request_error = EINVAL;
  expect_error({"0", "3", false}, Errc::bad_argument, EINVAL, "request", "another one");
}

TEST_F(GpioLineTest, AFailedSettingAnswersItsErrno) {
  auto line = open({"0", "3", false});
  ASSERT_TRUE(line);
  chip_.set_error = ENODEV;
  EXPECT_EQ(line->set(true), ENODEV);
  chip_.set_error = 0;
  EXPECT_EQ(line->set(true), 0);
}

TEST_F(GpioLineTest, MovingKeepsTheLineAndLetsTheOtherGo) {
  auto three = open({"0", "3", false});
  auto four = open({"0", "4", false});
  ASSERT_TRUE(three && four);
  EXPECT_EQ(four->set(true), 0);
  *four = std::move(*three);
  EXPECT_FALSE(chip_.line(4).used);
  EXPECT_FALSE(chip_.line(4).high);
  EXPECT_TRUE(chip_.line(3).used);
  EXPECT_EQ(four->set(true), 0);
  EXPECT_TRUE(chip_.line(3).high);
}

TEST_F(GpioLineTest, SaysWhichLibraryItUses) { EXPECT_THAT(gpio_library(), HasSubstr("libgpiod ")); }

}  // namespace
}  // namespace tm485::linux_hal::fake
