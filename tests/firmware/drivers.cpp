// Every register driver with its port, as a firmware has them. Built for each Cortex-M and never run: its undefined
// symbols are what tools/check.sh looks at.
#include "tm485/mcu/baud.hpp"
#include "tm485/mcu/cmsdk_uart.hpp"
#include "tm485/mcu/cycle_counter.hpp"
#include "tm485/mcu/dma_uart.hpp"
#include "tm485/mcu/interrupt_uart_port.hpp"
#include "tm485/mcu/nrf51_uart.hpp"
#include "tm485/mcu/pl011.hpp"
#include "tm485/mcu/polled_uart_port.hpp"
#include "tm485/mcu/register_access.hpp"
#include "tm485/mcu/stm32_usart_v1.hpp"
#include "tm485/mcu/stm32_usart_v2.hpp"
#include "tm485/mcu/timer_clock.hpp"
#include "tm485/mcu/uart16550.hpp"

namespace tm485::mcu {

/// A driver-enable pin as a register of a GPIO block: set and reset by one write.
struct Pin {
  bool operator()(bool on) const noexcept {
    registers.write32(0, on ? 1U : 1U << 16U);
    return true;
  }
  VolatileRegisters registers;
};

using Registers = VolatileRegisters;
template class PolledUartPort<Pl011<Registers>, CallDirection<Pin>>;
template class PolledUartPort<Pl011<Registers>, RtsDirection>;
template class PolledUartPort<Uart16550<Registers>, CallDirection<Pin>>;
template class PolledUartPort<Stm32UsartV1<Registers>, CallDirection<Pin>>;
template class PolledUartPort<Stm32UsartV2<Registers>, AutomaticDirection>;
template class PolledUartPort<CmsdkUart<Registers>, CallDirection<Pin>>;
template class PolledUartPort<Nrf51Uart<Registers>, CallDirection<Pin>>;

/// A one-shot timer as a register.
struct Shot {
  void arm(Time span) const noexcept { registers.write32(0, static_cast<std::uint32_t>(span.count())); }
  VolatileRegisters registers;
};

template class InterruptUartPort<Stm32UsartV1<Registers>, CallDirection<Pin>>;
template class InterruptUartPort<Stm32UsartV1<Registers>, CallDirection<Pin>, Shot>;
template class InterruptUartPort<Stm32UsartV2<Registers>, AutomaticDirection>;
template class InterruptUartPort<Stm32UsartV2<Registers, Oversampling::by8>, CallDirection<Pin>>;
template class InterruptUartPort<Pl011<Registers, Pl011Fifos::off>, CallDirection<Pin>, Shot>;
template class InterruptUartPort<CmsdkUart<Registers>, CallDirection<Pin>>;
template class InterruptUartPort<CmsdkUart<Registers>, CallDirection<Pin>, Shot>;

/// Two DMA channels as registers: address, count and control.
struct Send {
  void start(std::span<const std::uint8_t> bytes) noexcept {
    registers.write32(4, static_cast<std::uint32_t>(bytes.size()));
    registers.write32(0, 1);
  }
  std::size_t remaining() noexcept { return registers.read32(4); }
  bool complete() noexcept { return remaining() == 0; }
  bool failed() noexcept { return false; }
  void stop() noexcept { registers.write32(0, 0); }
  VolatileRegisters registers;
};
struct Receive {
  void start(std::span<std::uint8_t> ring) noexcept {
    registers.write32(4, static_cast<std::uint32_t>(ring.size()));
    registers.write32(0, 1);
  }
  std::size_t remaining() noexcept { return registers.read32(4); }
  bool failed() noexcept { return false; }
  void stop() noexcept { registers.write32(0, 0); }
  VolatileRegisters registers;
};
template class InterruptUartPort<DmaUart<Stm32UsartV1<Registers>, Send, Receive>, CallDirection<Pin>>;
template class InterruptUartPort<DmaUart<Stm32UsartV2<Registers>, Send, Receive>>;

/// A 16-bit timer that counts.
struct Count {
  static constexpr unsigned kBits = 16;
  std::uint32_t read() const noexcept { return registers.read16(0x24); }
  VolatileRegisters registers;
};
template class CycleCounter<Registers>;
template class TimerClock<CycleCounter<Registers>>;
template class TimerClock<Count>;

static_assert(Port<InterruptUartPort<Stm32UsartV1<Registers>, CallDirection<Pin>>>);
static_assert(Port<PolledUartPort<Stm32UsartV1<Registers>, CallDirection<Pin>>>);
static_assert(solve_baud(Stm32UsartV1<Registers>::kFamily, 84'000'000, 2'500'000));
static_assert(solve_baud(Stm32UsartV2<Registers>::kFamily, 170'000'000, 2'500'000));

}  // namespace tm485::mcu
