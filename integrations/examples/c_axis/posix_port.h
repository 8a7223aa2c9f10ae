/* A tm485_port on a serial line or pseudo-terminal of POSIX, for an adapter that switches its driver by itself. */
#pragma once

#include "tm485/c/tm485.h"

typedef struct posix_port {
  int descriptor;
  tm485_time sent_at; /* when the last stop bit of the last request has left; TM485_NEVER: nothing was sent */
} posix_port;

/* Opens it raw, at 2.5 Mbit/s, and fills in the table for the bus. Both must stay where they are while the bus lives.
   0, or -1 with errno. */
int posix_port_open(posix_port* self, tm485_port* table, const char* path);
void posix_port_close(posix_port* self);
