/* BBC micro:bit: nRF51822, Cortex-M0 at 16 MHz, its UART (P0.24, P0.25) for the encoder, TIMER0 as the counter. nRF51
   Reference Manual 3.0. In QEMU: microbit.

   A machine to run Cortex-M0 code on, not one to build: its UART makes 1 Mbit/s at most, its pins are wired to a USB
   bridge. The emulator's UART knows no rate. */
#pragma once

#include "board_functions.h"

#define BOARD_NAME "micro:bit"
#define BOARD_CORE_HZ 16000000u
#define BOARD_COUNTER_HZ 16000000u /* TIMER0 */

#define BOARD_ENCODER_UART 0x40002000u
#define BOARD_ENCODER_BIT_RATE 1000000u

#define BOARD_INTERRUPTS 32
#define BOARD_VECTORS [16 + 2] = on_encoder_uart
