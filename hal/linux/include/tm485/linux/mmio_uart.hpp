// MmioUart: a UART without the kernel's driver, polled byte by byte, as a port of the bus: for a thread that spins on
// an isolated core, where a tty costs interrupts, time-outs and a kernel thread.
//
// mapped (UIO or /dev/mem) -> rate solved -> set up, read back -> driver off the line -> ready
//
// The register drivers are those of hal/mcu (docs/adr/0012). Specification: sections 1 and 4.
#pragma once

#include <cstdint>
#include <expected>
#include <optional>
#include <string>
#include <utility>

#include "tm485/bus/port.hpp"
#include "tm485/linux/memory_mapping.hpp"
#include "tm485/linux/mmio_port.hpp"
#include "tm485/linux/os_error.hpp"
#include "tm485/mcu/baud.hpp"
#include "tm485/mcu/register_access.hpp"
#include "tm485/mcu/uart16550.hpp"
#include "tm485/time.hpp"

namespace tm485::linux_hal {

struct MmioOptions {
  MmioBlock block = MmioBlock::pl011;
  std::uint64_t address = 0;           ///< physical, of the first register; with `uio` 0 takes the device's
  std::uint32_t clock_hz = 0;          ///< the clock that the divisor divides, not 0
  std::uint32_t bit_rate = 2'500'000;  ///< bit/s, not 0; refused if the clock makes it more than 2 % wrong
  mcu::Layout16550 layout = {};        ///< of a 16550: distance and width of its registers
  std::string uio = {};                ///< "/dev/uio0"; empty: `memory`
  MmioDirection direction = {};
  Time driver_lead{0};                         ///< the driver is on this long before the start bit
  std::optional<Time> latency_allowance = {};  ///< replaces that of capability(), not negative
  std::optional<Time> shortest_exchange = {};  ///< replaces that of capability(), not negative
  std::optional<Time> release_bound = {};      ///< replaces that of capability(), not negative
  std::string memory = "/dev/mem";             ///< where physical memory is
  std::string sysfs = "/sys";                  ///< where the kernel describes its devices
};

/// One owner: the context of the bus. The functions of the port are those of MmioPort; none makes a system call,
/// `direction.call` apart. Replies are handed out within 100 us, with 5 us of jitter: what a loop that spins on a core of
/// its own holds. Release: 0 with an automatic transceiver; otherwise one pass of the loop, stated as 5 us and best effort,
/// since that is after T2 min, unless `release_bound` says better.
class MmioUart : public MmioPort<mcu::VolatileRegisters> {
 public:
  /// Maps and sets up. Errors: an OsError with the failed step, errno (where the system gave one) and a remedy:
  /// no permission, memory that the kernel keeps for itself, a kernel driver that still has the UART, a rate that the
  /// clock does not make, no UART of this kind at the address. Nothing stays mapped. Set-up; allocates.
  [[nodiscard]] static std::expected<MmioUart, OsError> open(const MmioOptions& options);

  MmioUart(MmioUart&&) noexcept = default;
  MmioUart& operator=(MmioUart&& other) noexcept;
  MmioUart(const MmioUart&) = delete;
  MmioUart& operator=(const MmioUart&) = delete;
  /// Takes the driver off the line, switches the UART off and unmaps it. The kernel's driver sets it up again when it
  /// is bound.
  ~MmioUart() { close(); }

  /// Takes the driver off the line, switches the UART off, unmaps it and lets go of what switches the driver, so that
  /// the same UART can be opened again. From then on every function of the port answers port_gone. Owner; system calls.
  void close() noexcept;

  /// The divisor that was set, its rate and its error.
  [[nodiscard]] const mcu::BaudDivisor& divisor() const noexcept { return divisor_; }

 private:
  MmioUart(MemoryMapping mapping, MmioPort port, const mcu::BaudDivisor& divisor)
      : MmioPort(std::move(port)), mapping_(std::move(mapping)), divisor_(divisor) {}

  MemoryMapping mapping_;
  mcu::BaudDivisor divisor_;
};

static_assert(Port<MmioUart>);

}  // namespace tm485::linux_hal
