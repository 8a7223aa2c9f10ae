#include "fake_tty.hpp"

#include <asm/termbits.h>
#include <sys/ioctl.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace tm485::linux_hal::fake {
namespace {

constexpr unsigned kUsbSerialMajor = 188;

termios2 unpack(const std::vector<std::byte>& bytes) {
  termios2 settings{};
  std::memcpy(&settings, bytes.data(), sizeof settings);
  return settings;
}

void pack(const termios2& settings, std::vector<std::byte>& bytes) {
  bytes.resize(sizeof settings);
  std::memcpy(bytes.data(), &settings, sizeof settings);
}

}  // namespace

FakeTty::FakeTty() {
  set_device_number(kUsbSerialMajor, 0);
  termios2 settings{};
  settings.c_iflag = ICRNL | IXON;
  settings.c_oflag = OPOST | ONLCR;
  settings.c_lflag = ICANON | ECHO | ISIG;
  settings.c_cflag = CS8 | CREAD | HUPCL | B9600;
  settings.c_ispeed = settings.c_ospeed = 9600;
  pack(settings, settings_);
  serial_.type = 4;  // PORT_16550A
  serial_.baud_base = 115'200;
}

void FakeTty::accept_only(std::vector<std::uint32_t> rates) {
  rate_rule = [rates = std::move(rates)](std::uint32_t asked, std::uint32_t old) {
    return std::find(rates.begin(), rates.end(), asked) != rates.end() ? asked : old;
  };
}

void FakeTty::fail_ioctl(unsigned long request, int error_number, int times) {
  ioctl_failures_[request] = {error_number, times};
}
void FakeTty::fail_read(int error_number, int times) { read_failure_ = {error_number, times}; }
void FakeTty::fail_write(int error_number, int times) { write_failure_ = {error_number, times}; }

void FakeTty::receive(const std::vector<std::uint8_t>& bytes) {
  for (const std::uint8_t byte : bytes) received_.push_back(std::byte{byte});
}

std::uint32_t FakeTty::rate() const { return unpack(settings_).c_ospeed; }
bool FakeTty::raw() const {
  const termios2 settings = unpack(settings_);
  return (settings.c_lflag & (ICANON | ECHO | ISIG)) == 0 && settings.c_iflag == 0 &&
         (settings.c_oflag & OPOST) == 0 && (settings.c_cflag & CSIZE) == CS8;
}
void FakeTty::set_rate(std::uint32_t rate) {
  termios2 settings = unpack(settings_);
  settings.c_ispeed = settings.c_ospeed = rate;
  pack(settings, settings_);
}

int FakeTty::ioctls(unsigned long request) const {
  const auto found = ioctl_calls_.find(request);
  return found == ioctl_calls_.end() ? 0 : found->second;
}

int FakeTty::take(Failure& failure) {
  if (failure.times == 0) return 0;
  --failure.times;
  return -failure.error_number;
}

int FakeTty::on_open(int, int) {
  if (unplugged_ || broken_) return -ENXIO;
  if (exclusive_ && open_count_ > 0 && !privileged) return -EBUSY;
  ++open_count_;
  return 0;
}

void FakeTty::on_close(int) {
  if (--open_count_ == 0) exclusive_ = false;
}

int FakeTty::on_ioctl(int, unsigned long request, void* argument) {
  ++calls_;
  ++ioctl_calls_[request];
  if (unplugged_ || broken_) return -EIO;
  if (const auto failure = ioctl_failures_.find(request); failure != ioctl_failures_.end()) {
    if (const int error = take(failure->second); error != 0) return error;
  }
  switch (request) {
    case TCGETS2:
    case TCSETS2:
    case TCSETSW2:
    case TCSETSF2:
      return settings_ioctl(request, argument);
    case TIOCEXCL:
      exclusive_ = true;
      return 0;
    case TIOCNXCL:
      exclusive_ = false;
      return 0;
    case TCFLSH:
      if (reinterpret_cast<std::uintptr_t>(argument) != TCOFLUSH) received_.clear();
      return 0;
    case TIOCGSERIAL:
    case TIOCSSERIAL:
    case TIOCGICOUNT:
      return serial_ioctl(request, argument);
    case TIOCOUTQ:
    case TIOCSERGETLSR:
    case TIOCINQ:
      return queue_ioctl(request, argument);
    case TIOCGRS485:
    case TIOCSRS485:
      return rs485_ioctl(request, argument);
    default:
      return -ENOTTY;
  }
}

int FakeTty::settings_ioctl(unsigned long request, void* argument) {
  if (request == TCGETS2) {
    std::memcpy(argument, settings_.data(), settings_.size());
    return 0;
  }
  termios2 wished{};
  std::memcpy(&wished, argument, sizeof wished);
  const std::uint32_t old = rate();
  wished.c_ospeed = wished.c_ispeed = rate_rule(wished.c_ospeed, old);
  if (request == TCSETSF2) received_.clear();
  pack(wished, settings_);
  return 0;
}

int FakeTty::serial_ioctl(unsigned long request, void* argument) {
  if (request == TIOCGICOUNT) {
    if (!has_icount) return -ENOTTY;
    std::memcpy(argument, &counters, sizeof counters);
    return 0;
  }
  if (!has_serial_struct) return -ENOTTY;
  if (request == TIOCGSERIAL) {
    std::memcpy(argument, &serial_, sizeof serial_);
    return 0;
  }
  std::memcpy(&serial_, argument, sizeof serial_);
  if (!keeps_low_latency) serial_.flags &= ~static_cast<int>(kLowLatency);
  return 0;
}

int FakeTty::queue_ioctl(unsigned long request, void* argument) {
  int answer = 0;
  if (request == TIOCOUTQ) {
    if (!has_outq) return -ENOTTY;
    if (outq_left_ > 0) answer = outq_left_--;
  } else if (request == TIOCSERGETLSR) {
    if (!has_lsr) return -ENOTTY;
    answer = outq_left_ > 0 || lsr_left_ > 0 ? 0 : TIOCSER_TEMT;
    if (lsr_left_ > 0) --lsr_left_;
  } else {
    answer = static_cast<int>(received_.size());
  }
  std::memcpy(argument, &answer, sizeof answer);
  return 0;
}

int FakeTty::rs485_ioctl(unsigned long request, void* argument) {
  if (!has_rs485) return -ENOTTY;
  if (request == TIOCSRS485) {
    std::memcpy(&rs485_, argument, sizeof rs485_);
    rs485_.flags &= rs485_mask;
  }
  std::memcpy(argument, &rs485_, sizeof rs485_);  // a driver answers what it has kept
  return 0;
}

ssize_t FakeTty::on_read(int, std::span<std::byte> buffer) {
  ++calls_;
  ++reads_;
  if (unplugged_) return 0;
  if (broken_) return -EIO;
  if (const int error = take(read_failure_); error != 0) return error;
  if (received_.empty()) return -EAGAIN;
  const std::size_t count = std::min({buffer.size(), received_.size(), read_limit});
  std::copy_n(received_.begin(), count, buffer.begin());
  received_.erase(received_.begin(), received_.begin() + static_cast<std::ptrdiff_t>(count));
  return static_cast<ssize_t>(count);
}

ssize_t FakeTty::on_write(int, std::span<const std::byte> bytes) {
  ++calls_;
  ++writes_;
  if (unplugged_ || broken_) return -EIO;
  if (const int error = take(write_failure_); error != 0) return error;
  const std::size_t count = std::min(bytes.size(), write_limit);
  if (fills_up_) write_limit -= count;
  if (count == 0) return -EAGAIN;
  std::vector<std::uint8_t> taken;
  for (const std::byte byte : bytes.first(count)) taken.push_back(std::to_integer<std::uint8_t>(byte));
  written_.insert(written_.end(), taken.begin(), taken.end());
  counters.tx += static_cast<int>(count);
  outq_left_ = outq_polls;
  lsr_left_ = lsr_polls;
  if (responder) receive(responder(taken));
  return static_cast<ssize_t>(count);
}

short FakeTty::on_poll(int, short events) {
  if (unplugged_ || broken_) return POLLHUP | POLLERR;
  int ready = events & POLLOUT;
  if (!received_.empty()) ready |= events & POLLIN;
  return static_cast<short>(ready);
}

}  // namespace tm485::linux_hal::fake
