#include "encoder_port.h"

#include "board.h"
#include "uart.h"

/* A transmitter that is not idle so long after its characters' time has failed. */
#define STUCK TM485_MS(50)
/* While a request is leaving it is looked at so often, should an interrupt stay away, as in QEMU. */
#define LOOK_EVERY TM485_US(50)

static void release(encoder_port* port, tm485_transmission_state state) {
  board_drive(false);
  uart_interrupts(BOARD_ENCODER_UART, UART_LISTEN);
  port->state = state;
}

static void send_on(encoder_port* port, tm485_time now) {
  const tm485_time end = port->start + port->character * port->count;
  while (port->written < port->count && uart_write(BOARD_ENCODER_UART, port->request[port->written]))
    ++port->written;
  if (port->written < port->count) {
    uart_interrupts(BOARD_ENCODER_UART, UART_ROOM);
  } else {
    if (port->idle_at == TM485_NEVER && uart_idle(BOARD_ENCODER_UART)) port->idle_at = now;
    if (port->idle_at == TM485_NEVER) {
      uart_interrupts(BOARD_ENCODER_UART, UART_SENT);
    } else if (now >= end && (!uart_hides_last_character || now - port->idle_at >= port->character)) {
      release(port, TM485_TRANSMISSION_SENT);
      return;
    } else {
      uart_interrupts(BOARD_ENCODER_UART, UART_LISTEN); /* the timer does the rest */
    }
  }
  if (now - end >= STUCK) release(port, TM485_TRANSMISSION_FAILED);
}

static void receive(encoder_port* port) {
  uint8_t byte;
  for (unsigned i = 0; i < ENCODER_PORT_ROOM && uart_read(BOARD_ENCODER_UART, &byte, &port->fault); ++i) {
    if (port->held == ENCODER_PORT_ROOM) {
      port->fault = TM485_ERR_OVERRUN;
    } else {
      port->received[port->held++] = byte;
    }
  }
}

void encoder_port_interrupt(encoder_port* port, tm485_time now) {
  uart_taken(BOARD_ENCODER_UART);
  if (port->state == TM485_TRANSMISSION_SENDING) send_on(port, now);
  receive(port);
}

tm485_time encoder_port_due(const encoder_port* port, tm485_time now) {
  if (port->state != TM485_TRANSMISSION_SENDING) return TM485_NEVER;
  return now + (port->idle_at == TM485_NEVER ? LOOK_EVERY : port->character);
}

/* ---- What the bus calls ---- */

static void capability(void* context, tm485_port_capability* to) {
  const encoder_port* const port = context;
  to->latency_allowance = port->allowance;
  to->timing = TM485_TIMING_HARD;
}

static tm485_errc try_send(void* context, const uint8_t* request, size_t count, tm485_time now,
                           tm485_time* start) {
  encoder_port* const port = context;
  if (port->state == TM485_TRANSMISSION_SENDING || count == 0 || count > sizeof port->request)
    return TM485_ERR_SEND_FAILED;
  for (size_t i = 0; i < count; ++i) port->request[i] = request[i];
  port->count = (uint8_t)count;
  port->written = 0;
  port->idle_at = TM485_NEVER;
  port->start = now;
  port->state = TM485_TRANSMISSION_SENDING;
  board_drive(true);
  send_on(port, now);
  *start = now;
  return TM485_OK;
}

static tm485_transmission_state transmission(void* context, tm485_time now, tm485_errc* fault) {
  encoder_port* const port = context;
  encoder_port_interrupt(port, now);
  if (port->state == TM485_TRANSMISSION_FAILED) *fault = TM485_ERR_SEND_FAILED;
  return port->state;
}

static void try_receive(void* context, uint8_t* buffer, size_t size, tm485_time now,
                        tm485_reception* reception) {
  encoder_port* const port = context;
  uint8_t left = 0;
  encoder_port_interrupt(port, now);
  for (uint8_t i = 0; i < port->held; ++i) {
    if (reception->count < size) {
      buffer[reception->count++] = port->received[i];
    } else {
      port->received[left++] = port->received[i];
    }
  }
  port->held = left;
  reception->fault = port->fault;
  port->fault = TM485_OK;
}

tm485_errc encoder_port_start(encoder_port* port, tm485_port* functions, tm485_time allowance) {
  static const encoder_port kEmpty;
  *port = kEmpty;
  port->allowance = allowance;
  port->character = (10000000000 + BOARD_ENCODER_BIT_RATE - 1) / BOARD_ENCODER_BIT_RATE;
  port->idle_at = TM485_NEVER;
  functions->context = port;
  functions->capability = capability;
  functions->try_send = try_send;
  functions->transmission = transmission;
  functions->try_receive = try_receive;
  if (!uart_start(BOARD_ENCODER_UART, BOARD_ENCODER_UART_HZ, BOARD_ENCODER_BIT_RATE))
    return TM485_ERR_BAD_ARGUMENT;
  release(port, TM485_TRANSMISSION_IDLE);
  return TM485_OK;
}
