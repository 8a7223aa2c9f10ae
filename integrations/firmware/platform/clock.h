/* The clock of the examples: nanoseconds since its start. Any context. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Takes DWT's cycle counter if it counts, which it does in silicon of Cortex-M3 and up, but not in QEMU and not on
   Cortex-M0; otherwise the board's counter. Answers true if it is the cycle counter. Set-up. */
bool clock_start(void);

/* Never goes back. Has to be called before the counter has come round: 25 s of a cycle counter at 168 MHz. */
int64_t clock_now(void);

#ifdef __cplusplus
}
#endif
