/* The four functions that a bus wants of a port. On a microcontroller they set registers instead. */
#define _DEFAULT_SOURCE /* B2500000 */
#include "posix_port.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

enum { kCharacterNs = 4000 }; /* ten bits at 2.5 Mbit/s */

/* What this port can hold. Nothing here is bounded by hardware, so the bus is told to wait long. */
static void capability(void* context, tm485_port_capability* to) {
  (void)context;
  to->shortest_exchange = TM485_MS(1);
  to->latency_allowance = TM485_MS(20);
  to->timing = TM485_TIMING_BEST_EFFORT;
}

static tm485_errc try_send(void* context, const uint8_t* request, size_t count, tm485_time now,
                           tm485_time* start) {
  posix_port* const self = (posix_port*)context;
  const ssize_t written = write(self->descriptor, request, count);
  if (written != (ssize_t)count)
    return written < 0 && errno == EIO ? TM485_ERR_PORT_GONE : TM485_ERR_SEND_FAILED;
  *start = now; /* an estimate: there are no wire timestamps */
  self->sent_at = now + (tm485_time)count * kCharacterNs;
  return TM485_OK;
}

static tm485_transmission_state transmission(void* context, tm485_time now, tm485_errc* fault) {
  const posix_port* const self = (const posix_port*)context;
  (void)fault;
  if (self->sent_at == TM485_NEVER) return TM485_TRANSMISSION_IDLE;
  return now >= self->sent_at ? TM485_TRANSMISSION_SENT : TM485_TRANSMISSION_SENDING;
}

static void try_receive(void* context, uint8_t* buffer, size_t size, tm485_time now,
                        tm485_reception* reception) {
  const posix_port* const self = (const posix_port*)context;
  const ssize_t count = read(self->descriptor, buffer, size);
  (void)now;
  if (count > 0) reception->count = (uint32_t)count;
  if (count < 0 && errno != EAGAIN && errno != EINTR) reception->fault = TM485_ERR_PORT_GONE;
}

int posix_port_open(posix_port* self, tm485_port* table, const char* path) {
  struct termios settings;
  self->sent_at = TM485_NEVER;
  self->descriptor = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (self->descriptor < 0) return -1;
  if (tcgetattr(self->descriptor, &settings) != 0) goto failed;
  settings.c_iflag = 0;
  settings.c_oflag = 0;
  settings.c_lflag = 0;
  settings.c_cflag = CS8 | CREAD | CLOCAL;
  settings.c_cc[VMIN] = 0; /* with O_NONBLOCK: nothing yet is EAGAIN or 0 */
  settings.c_cc[VTIME] = 0;
  if (cfsetispeed(&settings, B2500000) != 0 || cfsetospeed(&settings, B2500000) != 0) goto failed;
  if (tcsetattr(self->descriptor, TCSANOW, &settings) != 0) goto failed;
  (void)tcflush(self->descriptor, TCIOFLUSH);
  memset(table, 0, sizeof *table);
  table->context = self;
  table->capability = capability;
  table->try_send = try_send;
  table->transmission = transmission;
  table->try_receive = try_receive;
  return 0;

failed: {
  const int reason = errno;
  close(self->descriptor);
  errno = reason;
  return -1;
}
}

void posix_port_close(posix_port* self) { close(self->descriptor); }
