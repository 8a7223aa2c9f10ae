#include "fake_gpio.hpp"

#include <linux/gpio.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

namespace tm485::linux_hal::fake {
namespace {

constexpr unsigned kMajor = 511;  // nobody's

template <std::size_t Size>
void put(char (&field)[Size], const std::string& text) {
  std::snprintf(field, Size, "%s", text.c_str());
}

}  // namespace

/// The descriptor of a request: the line is held as long as it is open.
class FakeLineRequest : public FakeDevice {
 public:
  FakeLineRequest(FakeGpioChip& chip, unsigned offset) : chip_(chip), offset_(offset) {}

  int on_ioctl(int, unsigned long request, void* argument) override {
    if (request == GPIOHANDLE_SET_LINE_VALUES_IOCTL) {
      return chip_.set(offset_, static_cast<gpiohandle_data*>(argument)->values[0] != 0);
    }
    if (request == GPIO_V2_LINE_SET_VALUES_IOCTL) {
      const auto& values = *static_cast<gpio_v2_line_values*>(argument);
      if ((values.mask & 1) == 0) return -EINVAL;
      return chip_.set(offset_, (values.bits & 1) != 0);
    }
    return -ENOTTY;
  }

  void on_close(int) override {
    FakeGpioChip::Line& line = chip_.line(offset_);
    line.used = false;
    line.consumer.clear();
    chip_.log_.push_back("line " + std::to_string(offset_) + " released");
  }

 private:
  FakeGpioChip& chip_;
  unsigned offset_;
};

FakeGpioChip::FakeGpioChip(unsigned number, unsigned lines, EventLog& log) : number_(number), log_(log) {
  set_device_number(kMajor, number);
  for (unsigned offset = 0; offset < lines; ++offset) lines_[offset] = {};
}

void FakeGpioChip::add_to(FakeKernel& kernel, const std::string& folder) {
  kernel_ = &kernel;
  const std::string name = "gpiochip" + std::to_string(number_);
  const std::string numbers = std::to_string(kMajor) + ":" + std::to_string(number_);
  device_file_ = std::make_unique<FakeFile>(numbers + "\n");
  kernel.add(folder + name, *this);
  kernel.add("/sys/bus/gpio/devices/" + name + "/dev", *device_file_);          // libgpiod 1.6 compares it
  kernel.add_link("/sys/dev/char/" + numbers + "/subsystem", "/sys/bus/gpio");  // and 2.x this
}

int FakeGpioChip::on_ioctl(int, unsigned long request, void* argument) {
  switch (request) {
    case GPIO_GET_CHIPINFO_IOCTL: {
      auto& info = *static_cast<gpiochip_info*>(argument);
      put(info.name, "gpiochip" + std::to_string(number_));
      put(info.label, label);
      info.lines = static_cast<__u32>(lines_.size());
      return 0;
    }
    case GPIO_GET_LINEINFO_IOCTL:
      return info_v1(argument);
    case GPIO_V2_GET_LINEINFO_IOCTL:
      return info_v2(argument);
    case GPIO_GET_LINEHANDLE_IOCTL:
      return request_v1(argument);
    case GPIO_V2_GET_LINE_IOCTL:
      return request_v2(argument);
    default:
      return -ENOTTY;
  }
}

int FakeGpioChip::info_v1(void* argument) {
  auto& info = *static_cast<gpioline_info*>(argument);
  const auto found = lines_.find(info.line_offset);
  if (found == lines_.end()) return -EINVAL;
  const Line& line = found->second;
  info.flags = (line.used ? GPIOLINE_FLAG_KERNEL : 0U) | (line.output ? GPIOLINE_FLAG_IS_OUT : 0U) |
               (line.active_low ? GPIOLINE_FLAG_ACTIVE_LOW : 0U);
  put(info.name, line.name);
  put(info.consumer, line.consumer);
  return 0;
}

int FakeGpioChip::info_v2(void* argument) {
  auto& info = *static_cast<gpio_v2_line_info*>(argument);
  const auto found = lines_.find(info.offset);
  if (found == lines_.end()) return -EINVAL;
  const Line& line = found->second;
  info.flags = (line.used ? std::uint64_t{GPIO_V2_LINE_FLAG_USED} : 0U) |
               std::uint64_t{line.output ? GPIO_V2_LINE_FLAG_OUTPUT : GPIO_V2_LINE_FLAG_INPUT} |
               (line.active_low ? std::uint64_t{GPIO_V2_LINE_FLAG_ACTIVE_LOW} : 0U);
  info.num_attrs = 0;
  put(info.name, line.name);
  put(info.consumer, line.consumer);
  return 0;
}

int FakeGpioChip::request_v1(void* argument) {
  auto& asked = *static_cast<gpiohandle_request*>(argument);
  if (asked.lines != 1) return -EINVAL;
  asked.fd = request(asked.lineoffsets[0], (asked.flags & GPIOHANDLE_REQUEST_OUTPUT) != 0,
                     (asked.flags & GPIOHANDLE_REQUEST_ACTIVE_LOW) != 0, asked.default_values[0] != 0,
                     asked.consumer_label);
  return asked.fd < 0 ? asked.fd : 0;
}

int FakeGpioChip::request_v2(void* argument) {
  auto& asked = *static_cast<gpio_v2_line_request*>(argument);
  if (asked.num_lines != 1) return -EINVAL;
  // As the kernel: an attribute for the line replaces the request's flags.
  std::uint64_t flags = asked.config.flags;
  bool value = false;
  for (unsigned i = 0; i < asked.config.num_attrs; ++i) {
    const gpio_v2_line_config_attribute& attribute = asked.config.attrs[i];
    if ((attribute.mask & 1) == 0) continue;
    if (attribute.attr.id == GPIO_V2_LINE_ATTR_ID_FLAGS) flags = attribute.attr.flags;
    if (attribute.attr.id == GPIO_V2_LINE_ATTR_ID_OUTPUT_VALUES) value = (attribute.attr.values & 1) != 0;
  }
  asked.fd = request(asked.offsets[0], (flags & GPIO_V2_LINE_FLAG_OUTPUT) != 0,
                     (flags & GPIO_V2_LINE_FLAG_ACTIVE_LOW) != 0, value, asked.consumer);
  return asked.fd < 0 ? asked.fd : 0;
}

int FakeGpioChip::request(unsigned offset, bool output, bool active_low, bool value, std::string consumer) {
  const auto found = lines_.find(offset);
  if (found == lines_.end()) return -EINVAL;
  Line& line = found->second;
  if (line.used) return -EBUSY;
  if (request_error != 0) return -request_error;
  requests_.push_back(std::make_unique<FakeLineRequest>(*this, offset));
  const int fd = kernel_->make_descriptor(*requests_.back());
  if (fd < 0) return fd;
  line.used = true;
  line.output = output;
  line.active_low = active_low;
  line.consumer = std::move(consumer);
  ++line.requests;
  if (output) drive(offset, value);
  return fd;
}

int FakeGpioChip::set(unsigned offset, bool value) {
  if (set_error != 0) return -set_error;
  if (!lines_[offset].output) return -EPERM;
  ++sets_;
  drive(offset, value);
  return 0;
}

void FakeGpioChip::drive(unsigned offset, bool value) {
  Line& line = lines_[offset];
  line.high = value != line.active_low;
  log_.push_back("line " + std::to_string(offset) + (line.high ? " high" : " low"));
}

}  // namespace tm485::linux_hal::fake
