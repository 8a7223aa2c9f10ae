// A fake serial port: what a kernel's tty driver answers, and the ways in which drivers refuse, lie and vanish.
#pragma once

#include <linux/serial.h>

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "linux_fake/fake_kernel.hpp"

namespace tm485::linux_hal::fake {

class FakeTty : public FakeDevice {
 public:
  /// A port as ftdi_sio or pl011 makes one (major 188), at 9600 bit/s, that takes any rate.
  FakeTty();

  // ---- how the driver is ----

  /// The rate that is set when `asked` is wished while `old` stands. A kernel answers 0 whatever comes out of it.
  std::function<std::uint32_t(std::uint32_t asked, std::uint32_t old)> rate_rule =
      [](std::uint32_t asked, std::uint32_t) { return asked; };
  /// These rates and no other; the rest is refused silently: the old rate stays.
  void accept_only(std::vector<std::uint32_t> rates);

  bool has_rs485 = false;                  ///< otherwise TIOCSRS485 and TIOCGRS485 answer ENOTTY
  std::uint32_t rs485_mask = 0xFFFFFFFFU;  ///< flags that the driver keeps; the others are dropped silently
  bool has_icount = true;                  ///< otherwise TIOCGICOUNT answers ENOTTY
  bool has_serial_struct = true;           ///< otherwise TIOCGSERIAL and TIOCSSERIAL answer ENOTTY
  bool keeps_low_latency = true;           ///< otherwise ASYNC_LOW_LATENCY is dropped silently
  bool has_lsr = true;                     ///< otherwise TIOCSERGETLSR answers ENOTTY
  bool has_outq = true;                    ///< otherwise TIOCOUTQ answers ENOTTY
  bool privileged = false;                 ///< a caller with CAP_SYS_ADMIN, whom TIOCEXCL does not keep out

  /// The next `times` calls of an ioctl fail with `error_number`.
  void fail_ioctl(unsigned long request, int error_number, int times = 1);
  void fail_read(int error_number, int times = 1);
  void fail_write(int error_number, int times = 1);
  std::size_t write_limit = SIZE_MAX;  ///< bytes that one write takes at most; 0: EAGAIN
  /// As a buffer with room for `count` bytes: the writes after that get EAGAIN.
  void take_no_more_after(std::size_t count) {
    write_limit = count;
    fills_up_ = true;
  }

  /// How often TIOCOUTQ still tells of queued bytes after a write, and after that how often the transmitter is not empty.
  int outq_polls = 0;
  int lsr_polls = 0;

  // ---- what happens on the line ----

  /// Buffer and transmitter are empty from now on, whatever was said of polls.
  void end_of_sending() { outq_left_ = lsr_left_ = 0; }

  /// Bytes that the code under test will read.
  void receive(const std::vector<std::uint8_t>& bytes);
  std::size_t read_limit = SIZE_MAX;  ///< bytes that one read hands out at most
  /// Called with what a write took; its result is received. An encoder, for instance.
  std::function<std::vector<std::uint8_t>(const std::vector<std::uint8_t>&)> responder;
  /// As TIOCGICOUNT reports them.
  serial_icounter_struct counters{};
  /// As an unplugged USB adapter after its hang-up: read answers 0, everything else EIO, opening ENXIO.
  void unplug() { unplugged_ = true; }
  /// As on the way to it: everything EIO.
  void break_down() { broken_ = true; }

  // ---- what the code under test has done ----

  [[nodiscard]] const std::vector<std::uint8_t>& written() const { return written_; }
  void forget_written() { written_.clear(); }
  [[nodiscard]] std::uint32_t rate() const;
  [[nodiscard]] bool raw() const;
  void set_rate(std::uint32_t rate);
  [[nodiscard]] bool exclusive() const { return exclusive_; }
  [[nodiscard]] bool low_latency() const { return (serial_.flags & static_cast<int>(kLowLatency)) != 0; }
  [[nodiscard]] const serial_rs485& rs485() const { return rs485_; }
  [[nodiscard]] std::size_t unread() const { return received_.size(); }
  /// How often a call has come: by request, and the three others.
  [[nodiscard]] int ioctls(unsigned long request) const;
  [[nodiscard]] int reads() const { return reads_; }
  [[nodiscard]] int writes() const { return writes_; }
  [[nodiscard]] int calls() const { return calls_; }

  int on_open(int fd, int flags) override;
  int on_ioctl(int fd, unsigned long request, void* argument) override;
  ssize_t on_read(int fd, std::span<std::byte> buffer) override;
  ssize_t on_write(int fd, std::span<const std::byte> bytes) override;
  short on_poll(int fd, short events) override;
  void on_close(int fd) override;

 private:
  struct Failure {
    int error_number = 0;
    int times = 0;
  };
  static constexpr unsigned kLowLatency = 1U << 13;  ///< ASYNC_LOW_LATENCY

  [[nodiscard]] static int take(Failure& failure);
  int settings_ioctl(unsigned long request, void* argument);
  int serial_ioctl(unsigned long request, void* argument);
  int queue_ioctl(unsigned long request, void* argument);
  int rs485_ioctl(unsigned long request, void* argument);

  std::vector<std::byte> settings_;  ///< a termios2: its header and that of the C library exclude each other
  serial_struct serial_{};
  serial_rs485 rs485_{};
  std::map<unsigned long, Failure> ioctl_failures_;
  std::map<unsigned long, int> ioctl_calls_;
  Failure read_failure_, write_failure_;
  std::deque<std::byte> received_;
  std::vector<std::uint8_t> written_;
  bool fills_up_ = false;  ///< write_limit is what is left of the room
  bool unplugged_ = false, broken_ = false, exclusive_ = false;
  int open_count_ = 0, outq_left_ = 0, lsr_left_ = 0;
  int reads_ = 0, writes_ = 0, calls_ = 0;
};

}  // namespace tm485::linux_hal::fake
