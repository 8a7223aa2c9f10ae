/* A UART by its registers: what the port and the console need of it. One file for each kind: uart_stm32.c, uart_cmsdk.c.
   No function waits. The context that owns the block; uart_interrupts() belongs to it as well. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "tm485/c/base.h"

/* True for a block that says when its buffer is empty, but not when the character behind it has left. */
extern const bool uart_hides_last_character;

/* Which interrupts it makes, besides that of a received character. */
typedef enum uart_wants {
  UART_LISTEN, /* no other */
  UART_ROOM,   /* there is room for a byte */
  UART_SENT    /* the last stop bit has left; where the block cannot say that: as UART_ROOM */
} uart_wants;

/* 8N1, transmitter and receiver on, no interrupts. False: the clock cannot make the rate within 2 %, or the registers do not
   keep what is written. Set-up. */
bool uart_start(uint32_t base, uint32_t clock_hz, uint32_t bit_rate);
void uart_interrupts(uint32_t base, uart_wants wants);
/* At the begin of the interrupt: takes it back, where a block wants that. */
void uart_taken(uint32_t base);
/* False: no room. */
bool uart_write(uint32_t base, uint8_t byte);
/* Nothing waits, and the last stop bit has left (see uart_hides_last_character). */
bool uart_idle(uint32_t base);
/* True: a character. `fault` is set to TM485_ERR_OVERRUN or TM485_ERR_FRAMING_ERROR if the receiver has found one, and is
   otherwise left alone. */
bool uart_read(uint32_t base, uint8_t* byte, tm485_errc* fault);
