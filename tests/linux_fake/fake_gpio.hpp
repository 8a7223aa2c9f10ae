// A fake GPIO chip: the character device of the kernel with the requests of both its interfaces, as libgpiod 1.6 and 2.x
// make them, and a log of what happened in which order.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "linux_fake/fake_kernel.hpp"

namespace tm485::linux_hal::fake {

/// What happened on the lines and the ports of a test, in order.
using EventLog = std::vector<std::string>;

class FakeGpioChip : public FakeDevice {
 public:
  struct Line {
    std::string name;
    std::string consumer;  ///< of the program that holds it, or of a driver
    bool used = false;     ///< by a request, or by a driver
    bool output = false;
    bool high = false;  ///< the level on the pin
    bool active_low = false;
    int requests = 0;  ///< how often it was requested with success
  };

  /// A chip of `lines` lines without names, as gpiochip<number>: there after add_to().
  FakeGpioChip(unsigned number, unsigned lines, EventLog& log);
  /// Puts it into `kernel` as <folder>gpiochip<number>, and what libgpiod looks up in sysfs.
  void add_to(FakeKernel& kernel, const std::string& folder);

  Line& line(unsigned offset) { return lines_.at(offset); }
  std::string label = "fake-chip";
  int request_error = 0;  ///< of every request, if not 0
  int set_error = 0;      ///< of every setting of a value, if not 0
  /// Settings of a value since the beginning.
  [[nodiscard]] int sets() const { return sets_; }

  int on_ioctl(int fd, unsigned long request, void* argument) override;

 private:
  friend class FakeLineRequest;
  int info_v1(void* argument);
  int info_v2(void* argument);
  int request_v1(void* argument);
  int request_v2(void* argument);
  int request(unsigned offset, bool output, bool active_low, bool value, std::string consumer);
  int set(unsigned offset, bool value);
  void drive(unsigned offset, bool value);

  unsigned number_;
  EventLog& log_;
  FakeKernel* kernel_ = nullptr;
  std::unique_ptr<FakeFile> device_file_;
  std::map<unsigned, Line> lines_;
  std::vector<std::unique_ptr<FakeDevice>> requests_;
  int sets_ = 0;
};

}  // namespace tm485::linux_hal::fake
