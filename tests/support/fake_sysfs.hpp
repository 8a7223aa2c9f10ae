// A /sys and a /dev in a temporary folder, laid out as the kernel lays them out.
#pragma once

#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

namespace tm485::test {

class FakeSysfs {
 public:
  struct Usb {
    std::string vendor, product, release;  ///< four hexadecimal digits each, as the kernel writes them
    std::string driver;                    ///< ftdi_sio, ch341, cdc_acm
    std::string speed = "480";
    std::string serial = "A1";
    std::string product_text = "USB serial";
    std::string latency_timer = {};  ///< empty: none
    bool by_id = true;
  };

  FakeSysfs() {
    std::string name = (std::filesystem::temp_directory_path() / "tm485_sysfs_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("mkdtemp");
    root_ = std::filesystem::canonical(name);
    std::filesystem::create_directories(root_ / "sys/class/tty");
    std::filesystem::create_directories(root_ / "dev");
  }
  ~FakeSysfs() {
    std::error_code ignored;
    std::filesystem::remove_all(root_, ignored);
  }
  FakeSysfs(const FakeSysfs&) = delete;
  FakeSysfs& operator=(const FakeSysfs&) = delete;

  [[nodiscard]] std::string sys() const { return (root_ / "sys").string(); }
  [[nodiscard]] std::string dev() const { return (root_ / "dev").string(); }
  [[nodiscard]] std::string dev(const std::string& name) const { return (root_ / "dev" / name).string(); }
  [[nodiscard]] std::string by_id(const std::string& serial) const {
    return (root_ / "dev/serial/by-id" / ("usb-" + serial + "-if00-port0")).string();
  }
  [[nodiscard]] std::string latency_timer(const std::string& name) const {
    return (root_ / "sys/class/tty" / name / "device/latency_timer").string();
  }

  /// A USB adapter. Those of usb-serial have a device of their own for the port, cdc_acm has not.
  void add_usb(const std::string& name, const Usb& usb) {
    const std::filesystem::path device = root_ / "sys/devices/pci0000:00/usb1" / ("1-" + name);
    write(device / "idVendor", usb.vendor);
    write(device / "idProduct", usb.product);
    write(device / "bcdDevice", usb.release);
    write(device / "speed", usb.speed);
    write(device / "serial", usb.serial);
    write(device / "product", usb.product_text);
    link(device / "driver", root_ / "sys/bus/usb/drivers/usb");
    const std::filesystem::path interface = device / ("1-" + name + ":1.0");
    const std::filesystem::path port = usb.driver == "cdc_acm" ? interface : interface / name;
    std::filesystem::create_directories(port);
    link(port / "driver", root_ / "sys/bus/usb-serial/drivers" / usb.driver);
    if (!usb.latency_timer.empty()) write(port / "latency_timer", usb.latency_timer);
    add_tty(name, port);
    if (usb.by_id) link(by_id(usb.serial), dev(name));
  }

  /// A UART of the board, as kernels from 6.6 on show it: two layers of the serial core between tty and device.
  void add_uart(const std::string& name, const std::string& driver, std::uint32_t clock_hz,
                const std::string& type = "4") {
    const std::filesystem::path device = root_ / "sys/devices/platform" / (name + ".serial");
    const std::filesystem::path port = device / (name + ":0") / (name + ":0.0");
    std::filesystem::create_directories(port);
    link(device / "driver", root_ / "sys/bus/platform/drivers" / driver);
    link(port / "driver", root_ / "sys/bus/serial-base/drivers/port");
    link(port / "subsystem", root_ / "sys/bus/serial-base");
    add_tty(name, port);
    write(root_ / "sys/class/tty" / name / "uartclk", std::to_string(clock_hz));
    write(root_ / "sys/class/tty" / name / "type", type);
  }

  void set_attribute(const std::string& name, const std::string& attribute, const std::string& value) {
    write(root_ / "sys/class/tty" / name / attribute, value);
  }

  /// A console: a tty without a device.
  void add_console(const std::string& name) {
    std::filesystem::create_directories(root_ / "sys/class/tty" / name);
    write(dev(name), "");
  }

  /// All that the kernel and udev take away when it is unplugged.
  void remove(const std::string& name, const std::string& serial) {
    std::filesystem::remove_all(root_ / "sys/class/tty" / name);
    std::filesystem::remove_all(root_ / "sys/devices/pci0000:00/usb1" / ("1-" + name));
    std::filesystem::remove(dev(name));
    std::filesystem::remove(by_id(serial));
  }

 private:
  static void write(const std::filesystem::path& file, const std::string& text) {
    std::filesystem::create_directories(file.parent_path());
    std::ofstream(file) << text << '\n';
  }
  static void link(const std::filesystem::path& from, const std::filesystem::path& to) {
    std::filesystem::create_directories(from.parent_path());
    if (!std::filesystem::exists(to)) std::filesystem::create_directories(to);
    std::filesystem::create_symlink(to, from);
  }
  void add_tty(const std::string& name, const std::filesystem::path& port) {
    write(dev(name), "");
    link(root_ / "sys/class/tty" / name / "device", port);
  }

  std::filesystem::path root_;
};

}  // namespace tm485::test
