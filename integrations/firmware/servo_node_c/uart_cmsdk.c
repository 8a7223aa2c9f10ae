/* The APB UART of ARM's Cortex-M System Design Kit. ARM DDI 0479, 4.3. It notices no missing stop bit. */
#include "cortex_m.h"
#include "uart.h"

#define DATA(base) REGISTER32((base) + 0x00u)
#define STATE(base) REGISTER32((base) + 0x04u)
#define CTRL(base) REGISTER32((base) + 0x08u)
#define INTCLEAR(base) REGISTER32((base) + 0x0Cu)
#define BAUDDIV(base) REGISTER32((base) + 0x10u)

enum { TX_FULL = 1u << 0, RX_FULL = 1u << 1, RX_OVERRUN = 1u << 3 };
enum { TX_ON = 1u << 0, RX_ON = 1u << 1, TX_INTERRUPT = 1u << 2, RX_INTERRUPT = 1u << 3 };

const bool uart_hides_last_character = true;

bool uart_start(uint32_t base, uint32_t clock_hz, uint32_t bit_rate) {
  const uint32_t divisor = (clock_hz + bit_rate / 2u) / bit_rate;
  const uint32_t rate = clock_hz / (divisor == 0 ? 1u : divisor);
  const uint32_t error = rate > bit_rate ? rate - bit_rate : bit_rate - rate;
  if (divisor < 16u || divisor > 0xFFFFFu || error > bit_rate / 50u) return false;
  CTRL(base) = 0;
  BAUDDIV(base) = divisor;
  CTRL(base) = TX_ON | RX_ON;
  return BAUDDIV(base) == divisor;
}

void uart_interrupts(uint32_t base, uart_wants wants) {
  CTRL(base) = TX_ON | RX_ON | RX_INTERRUPT | (wants == UART_LISTEN ? 0u : TX_INTERRUPT);
}

void uart_taken(uint32_t base) { INTCLEAR(base) = 3u; }

bool uart_write(uint32_t base, uint8_t byte) {
  if ((STATE(base) & TX_FULL) != 0) return false;
  DATA(base) = byte;
  return true;
}

bool uart_idle(uint32_t base) { return (STATE(base) & TX_FULL) == 0; }

bool uart_read(uint32_t base, uint8_t* byte, tm485_errc* fault) {
  const uint32_t state = STATE(base);
  if ((state & RX_OVERRUN) != 0) {
    STATE(base) = RX_OVERRUN; /* writing 1 clears it */
    *fault = TM485_ERR_OVERRUN;
  }
  if ((state & RX_FULL) == 0) return false;
  *byte = (uint8_t)DATA(base);
  return true;
}
