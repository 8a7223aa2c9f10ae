/* The USART of STM32F1, F2, F4 and L1. ST RM0090, 30.6. */
#include "cortex_m.h"
#include "uart.h"

#define SR(base) REGISTER32((base) + 0x00u)
#define DR(base) REGISTER32((base) + 0x04u)
#define BRR(base) REGISTER32((base) + 0x08u)
#define CR1(base) REGISTER32((base) + 0x0Cu)

enum { FE = 1u << 1, ORE = 1u << 3, RXNE = 1u << 5, TC = 1u << 6, TXE = 1u << 7 };
enum { RE = 1u << 2, TE = 1u << 3, RXNEIE = 1u << 5, TCIE = 1u << 6, TXEIE = 1u << 7, UE = 1u << 13 };

const bool uart_hides_last_character = false;

bool uart_start(uint32_t base, uint32_t clock_hz, uint32_t bit_rate) {
  const uint32_t divisor = (clock_hz + bit_rate / 2u) / bit_rate; /* 16 samples a bit: BRR is clock / rate */
  const uint32_t rate = clock_hz / (divisor == 0 ? 1u : divisor);
  const uint32_t error = rate > bit_rate ? rate - bit_rate : bit_rate - rate;
  if (divisor < 16u || divisor > 0xFFFFu || error > bit_rate / 50u) return false;
  CR1(base) = 0;
  BRR(base) = divisor;
  CR1(base) = UE | TE | RE;
  return BRR(base) == divisor;
}

void uart_interrupts(uint32_t base, uart_wants wants) {
  CR1(base) = UE | TE | RE | RXNEIE | (wants == UART_ROOM ? TXEIE : 0u) | (wants == UART_SENT ? TCIE : 0u);
}

void uart_taken(uint32_t base) { (void)base; }

/* Reading SR before DR is written clears the completion of the request before. */
bool uart_write(uint32_t base, uint8_t byte) {
  if ((SR(base) & TXE) == 0) return false;
  DR(base) = byte;
  return true;
}

bool uart_idle(uint32_t base) { return (SR(base) & TC) != 0; }

bool uart_read(uint32_t base, uint8_t* byte, tm485_errc* fault) {
  const uint32_t status = SR(base);
  if ((status & ORE) != 0) *fault = TM485_ERR_OVERRUN;
  if ((status & RXNE) == 0) {
    if ((status & ORE) != 0) (void)DR(base); /* clears it */
    return false;
  }
  *byte = (uint8_t)DR(base);
  if ((status & FE) != 0) *fault = TM485_ERR_FRAMING_ERROR;
  return true;
}
