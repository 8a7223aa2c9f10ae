#include "core_interrupts.h"

#include "board.h"
#include "cortex_m.h"

#define SYSTICK_CONTROL REGISTER32(0xE000E010u)
#define SYSTICK_RELOAD REGISTER32(0xE000E014u)
#define SYSTICK_VALUE REGISTER32(0xE000E018u)
#define INTERRUPT_CONTROL REGISTER32(0xE000ED04u) /* ICSR */
#define SYSTEM_PRIORITIES REGISTER32(0xE000ED20u) /* SHPR3: SysTick in the highest byte, PendSV below it */

void core_interrupts_start(void) { SYSTEM_PRIORITIES = PRIORITY_BUS << 24 | PRIORITY_CONTROL << 16; }

void bus_timer_in(int64_t ns) {
  const uint32_t span = (uint32_t)(ns < 1000 ? 1000 : ns > 50000000 ? 50000000 : ns);
  /* In units of 64 ns, so that 32 bits are enough; a count too few does no harm. */
  SYSTICK_RELOAD = span / 64u * (BOARD_CORE_HZ / 1000000u) * 8u / 125u;
  SYSTICK_VALUE = 0;   /* from the beginning */
  SYSTICK_CONTROL = 7; /* on, with its interrupt, on the core's clock */
}

void control_now(void) { INTERRUPT_CONTROL = 1u << 28; }
