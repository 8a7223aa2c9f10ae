/* Two interrupts that every Cortex-M has: SysTick as the bus's timer, PendSV as the control loop's interrupt. A drive has
   timers for both; here they save a board's file. */
#pragma once

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Sets the priorities. Set-up. */
void core_interrupts_start(void);
/* on_bus_timer() once after `ns`, cut to 1 us .. 50 ms; replaces what was asked for before. If it is not asked again, it
   comes again: earlier than asked is always allowed. The bus's context, and set-up. */
void bus_timer_in(int64_t ns);
/* on_control() as soon as its priority allows. Any context. */
void control_now(void);

#ifdef __cplusplus
}
#endif
