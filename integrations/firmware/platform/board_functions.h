/* What a board does for the examples; included by its board.h, which says where everything is. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Clocks of the blocks and pins; the core's clock is the project's (docs/firmware.md). Before main(). */
void board_start(void);
/* The RS-485 driver; true: on the line. One register write. Any context. */
void board_drive(bool on);
/* A counter of 32 bits that runs at BOARD_COUNTER_HZ, for the clock where the core has none. Any context. */
uint32_t board_counter(void);

/* The interrupts of the application, in the vector table. */
void on_bus_timer(void);    /* SysTick */
void on_control(void);      /* PendSV */
void on_encoder_uart(void); /* BOARD_ENCODER_INTERRUPTS */

#ifdef __cplusplus
}
#endif
