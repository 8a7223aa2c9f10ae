/* Vector table and start-up: memory, floating-point unit, board, main(). What main() answers is the exit code.
   ARM DDI 0403, B1.5.3 (vector table) and B3.2.20 (coprocessor access). */
#include <stdint.h>

#include "board.h"
#include "cortex_m.h"
#include "semihosting.h"

/* Set by the linker script. */
extern uint32_t data_from[], data_begin[], data_end[], bss_begin[], bss_end[], stack_top[];

int main(void);
void reset_handler(void);

/* An interrupt that nobody expects, or a fault: an exit code that main() never answers. In a product: torque off, reset. */
static void unexpected(void) { host_exit(99); }

typedef void (*vector)(void);

/* All others are 0: what nobody has switched on does not come; if it did, the core would fault. */
__attribute__((section(".vectors"), used)) static const vector vectors[16 + BOARD_INTERRUPTS] = {
    [0] = (vector)(uintptr_t)stack_top,
    [1] = reset_handler,
    [2] = unexpected, /* NMI */
    [3] = unexpected, /* hard fault */
    [4] = unexpected, /* memory management */
    [5] = unexpected, /* bus fault */
    [6] = unexpected, /* usage fault */
    [14] = on_control,
    [15] = on_bus_timer,
    BOARD_VECTORS};

void reset_handler(void) {
  const uint32_t* from = data_from;
  for (uint32_t* to = data_begin; to < data_end;) *to++ = *from++;
  for (uint32_t* to = bss_begin; to < bss_end;) *to++ = 0;
#if defined(__ARM_FP)
  REGISTER32(0xE000ED88u) |= 0xFu << 20; /* CPACR: coprocessors 10 and 11 */
  __asm volatile("dsb\n isb");
#endif
  board_start();
  host_exit(main());
}
