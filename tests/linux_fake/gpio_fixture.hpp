// Two fake GPIO chips of eight lines in a folder of their own. Skips where libgpiod was left out of the build.
#pragma once

#include <gmock/gmock.h>
#include <unistd.h>

#include <cstdlib>
#include <expected>
#include <fstream>
#include <string>

#include "linux_fake/fake_gpio.hpp"
#include "tm485/linux/gpio_line.hpp"

namespace tm485::linux_hal::fake {

class GpioFixture : public ::testing::Test {
 protected:
  GpioFixture() {
    char name[] = "/tmp/tm485_gpio_XXXXXX";
    folder_ = std::string(mkdtemp(name)) + "/";
    for (const char* chip : {"gpiochip0", "gpiochip1", "gpiochipX"}) std::ofstream(folder_ + chip).flush();
    chip_.add_to(kernel_, folder_);
    other_.add_to(kernel_, folder_);
  }
  ~GpioFixture() override {
    for (const char* chip : {"gpiochip0", "gpiochip1", "gpiochipX"}) unlink((folder_ + chip).c_str());
    rmdir(folder_.c_str());
  }
  void SetUp() override {
    if (gpio_library().empty()) GTEST_SKIP() << "built without libgpiod";
  }

  [[nodiscard]] GpioOptions options() const {
    GpioOptions options;
    options.chip_folder = folder_;
    return options;
  }
  [[nodiscard]] std::expected<GpioLine, OsError> open(const GpioAddress& address) const {
    return GpioLine::open(address, options());
  }
  /// Opening it fails like this, and leaves nothing open and no line requested.
  void expect_error(const GpioAddress& address, Errc code, int error_number, const std::string& what,
                    const std::string& remedy) {
    const std::size_t descriptors = kernel_.open_descriptors();
    const auto line = open(address);
    ASSERT_FALSE(line) << address.chip << " " << address.line;
    EXPECT_EQ(line.error().code, code);
    EXPECT_EQ(line.error().error_number, error_number);
    EXPECT_THAT(line.error().what, ::testing::HasSubstr(what));
    EXPECT_THAT(line.error().remedy, ::testing::HasSubstr(remedy));
    EXPECT_EQ(kernel_.open_descriptors(), descriptors);
  }

  EventLog log_;
  std::string folder_;
  FakeKernel kernel_;
  FakeGpioChip chip_{0, 8, log_};
  FakeGpioChip other_{1, 8, log_};
};

}  // namespace tm485::linux_hal::fake
