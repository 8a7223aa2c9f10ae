/* STM32F405 at 168 MHz: USART1 (PA9, PA10; driver enable on PA8) for the encoder, USART2 (PA2, PA3) for the console.
   ST RM0090. In QEMU: netduinoplus2. */
#pragma once

#include "board_functions.h"

#define BOARD_NAME "STM32F405"
#define BOARD_CORE_HZ 168000000u
/* Only the emulator needs it: TIM5, to which QEMU 7.2 gives 1 GHz whatever the clocks are. Its interrupts cannot be used
   there: the alarms of that model come too late by the time since power-up. */
#define BOARD_COUNTER_HZ 1000000000u

#define BOARD_ENCODER_UART 0x40011000u
#define BOARD_ENCODER_UART_HZ 84000000u /* APB2 */
#define BOARD_ENCODER_BIT_RATE 2500000u
#define BOARD_ENCODER_INTERRUPTS 37u
#define BOARD_CONSOLE_UART 0x40004400u
#define BOARD_CONSOLE_UART_HZ 42000000u /* APB1 */
#define BOARD_CONSOLE_BIT_RATE 115200u

#define BOARD_INTERRUPTS 82
#define BOARD_VECTORS [16 + 37] = on_encoder_uart
