/* The port: what the bus needs from the line to the encoder, over uart.h and the board's driver-enable pin.

   The bus calls it from its own interrupts, and encoder_port_interrupt() belongs into the same: bus timer and UART have
   one priority here, so nothing of it is ever interrupted by itself. */
#pragma once

#include "tm485/c/port.h"

#define ENCODER_PORT_ROOM 16u /* the longest reply has 11 characters */

typedef struct encoder_port {
  tm485_time allowance; /* last stop bit on the wire until the software has the byte, at most */
  tm485_time character; /* ten bits */
  tm485_time start;     /* of the request under way */
  tm485_time idle_at;   /* when the transmitter was first seen idle; TM485_NEVER: not yet */
  tm485_transmission_state state;
  uint8_t request[4];
  uint8_t count;
  uint8_t written;
  uint8_t received[ENCODER_PORT_ROOM];
  uint8_t held;     /* of these */
  tm485_errc fault; /* of the receiver, since the bus has asked */
} encoder_port;

/* Sets the UART up and takes the driver off the line. TM485_ERR_BAD_ARGUMENT: the clock cannot make the rate. */
TM485_NODISCARD tm485_errc encoder_port_start(encoder_port* port, tm485_port* functions,
                                              tm485_time allowance);

/* The body of the UART's interrupt and of the timer's: feeds the transmitter, releases the driver, takes what came. */
void encoder_port_interrupt(encoder_port* port, tm485_time now);

/* When it has to be called again, should no interrupt of the UART come; TM485_NEVER: it need not. */
tm485_time encoder_port_due(const encoder_port* port, tm485_time now);
