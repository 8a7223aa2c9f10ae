/* nRF51 Reference Manual 3.0: UART 29.10, TIMER 18.3. */
#include "board.h"

#include "cortex_m.h"

#define UART_PIN_OUT REGISTER32(BOARD_ENCODER_UART + 0x50Cu)
#define UART_PIN_IN REGISTER32(BOARD_ENCODER_UART + 0x514u)
#define TIMER0_START REGISTER32(0x40008000u)
#define TIMER0_CAPTURE REGISTER32(0x40008040u)
#define TIMER0_BITS REGISTER32(0x40008508u)
#define TIMER0_PRESCALER REGISTER32(0x40008510u)
#define TIMER0_CAPTURED REGISTER32(0x40008540u)

void board_start(void) {
  UART_PIN_OUT = 24;
  UART_PIN_IN = 25;
  TIMER0_BITS = 3; /* 32 */
  TIMER0_PRESCALER = 0;
  TIMER0_START = 1;
}

void board_drive(bool on) { (void)on; }

/* Called with interrupts off (clock_now), so nobody captures in between. */
uint32_t board_counter(void) {
  TIMER0_CAPTURE = 1;
  return TIMER0_CAPTURED;
}
