/* ARM MPS2 with image AN386, a Cortex-M4F at 25 MHz: UART0 for the encoder, UART1 for the console. ARM DAI 0386. In QEMU:
   mps2-an386.

   A second machine to run on, not one to build: its UART divides 25 MHz by 16 at least, 1.5625 Mbit/s, and no pin
   switches an RS-485 driver. The emulator's UART knows no rate. */
#pragma once

#include "board_functions.h"

#define BOARD_NAME "MPS2 AN386"
#define BOARD_CORE_HZ 25000000u
#define BOARD_COUNTER_HZ 25000000u /* TIMER0 */

#define BOARD_ENCODER_UART 0x40004000u
#define BOARD_ENCODER_UART_HZ 25000000u
#define BOARD_ENCODER_BIT_RATE 1562500u
#define BOARD_ENCODER_INTERRUPTS 0u, 1u /* receive, transmit */
#define BOARD_CONSOLE_UART 0x40005000u
#define BOARD_CONSOLE_UART_HZ 25000000u
#define BOARD_CONSOLE_BIT_RATE 115200u

#define BOARD_INTERRUPTS 32
#define BOARD_VECTORS [16 + 0] = on_encoder_uart, [16 + 1] = on_encoder_uart
