/* The smallest firmware in C with a whole bus in it, as firmware.cpp is the one in C++: never run; its size and its
   undefined symbols are what tools/check.sh looks at. */
#include "tm485/c/bus.h"

/* A UART as registers, without a chip behind them. */
typedef struct uart {
  uint32_t status; /* bit 0: a byte was received, bit 1: the last stop bit has left */
  uint32_t data;
  uint32_t nanoseconds;
} uart;

static void capability(void* context, tm485_port_capability* to) {
  (void)context;
  to->latency_allowance = TM485_US(4);
  to->timing = TM485_TIMING_HARD;
}

static tm485_errc try_send(void* context, const uint8_t* request, size_t count, tm485_time now,
                           tm485_time* start) {
  volatile uart* const registers = context;
  size_t i;
  for (i = 0; i < count; ++i) registers->data = request[i];
  *start = now;
  return TM485_OK;
}

static tm485_transmission_state transmission(void* context, tm485_time now, tm485_errc* fault) {
  const volatile uart* const registers = context;
  (void)now;
  (void)fault;
  return (registers->status & 2U) != 0 ? TM485_TRANSMISSION_SENT : TM485_TRANSMISSION_SENDING;
}

static void try_receive(void* context, uint8_t* buffer, size_t size, tm485_time now, tm485_reception* to) {
  volatile uart* const registers = context;
  (void)now;
  while (to->count < size && (registers->status & 1U) != 0) buffer[to->count++] = (uint8_t)registers->data;
}

/* Where the samples go. */
volatile int64_t firmware_position;

static tm485_profile profile;
static tm485_bus bus;

void firmware_entry(uart* registers);
void firmware_entry(uart* registers) {
  tm485_port port = {registers, capability, try_send, transmission, try_receive};
  tm485_bus_config config;
  tm485_time now = 0;
  if (tm485_profile_init(&profile, "tm485_17") != TM485_OK) return;
  tm485_bus_config_default(&config);
  if (tm485_bus_init(&bus, &port, &profile, &config) != TM485_OK) return;
  if (tm485_bus_start(&bus, now, NULL) != TM485_OK) return;
  for (;;) {
    tm485_sample sample;
    tm485_completion completion;
    now += ((volatile uart*)registers)->nanoseconds;
    tm485_bus_poll(&bus, now);
    tm485_bus_latest(&bus, &sample);
    firmware_position = sample.position;
    if (tm485_bus_get_state(&bus) == TM485_STATE_RUNNING && !tm485_bus_take_completion(&bus, &completion)) {
      tm485_request request;
      if (tm485_request_make(&request, TM485_ID_ENCODER_ID) == TM485_OK &&
          tm485_bus_offer(&bus, &request, 1) == TM485_ERR_BAD_ARGUMENT)
        return;
    }
  }
}
