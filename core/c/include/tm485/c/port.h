/* The port: what a bus needs from a half-duplex line, as a table of functions that the user writes.

   The contract: when a send is reported complete, the last stop bit has left, the driver is released and the line is
   idle. No function blocks, waits or allocates; a request is sent as one gapless burst; the port never sends on its own
   account; bytes that it receives are handed out once, in order. The bus calls all of them, in its own context only.
   Specification: sections 1 and 4. docs/c-interface.md has one written out. */
#pragma once

#include "tm485/c/base.h"

#ifdef __cplusplus
extern "C" {
#endif

/* How far a port's timing can be trusted. */
typedef uint8_t tm485_timing_class;
enum {
  TM485_TIMING_HARD,       /* bounded by hardware */
  TM485_TIMING_SOFT,       /* bounded in practice: a real-time thread on a quiet machine */
  TM485_TIMING_BEST_EFFORT /* no bound: a USB adapter, a pseudo-terminal, software direction control */
};

/* What a port can hold. Asked when a bus is made; constant afterwards. */
typedef struct tm485_port_capability {
  tm485_time
      shortest_exchange;    /* shortest request start to next request start, for any ID; 0: only T1 limits */
  tm485_time jitter_margin; /* a request may start this much later than asked without being late */
  tm485_time latency_allowance; /* last stop bit on the wire until try_receive hands the byte out, at most */
  tm485_time release_bound;     /* last stop bit of a request until the driver is off the line, at most */
  uint8_t wire_timestamps;      /* 1: first_start is exact, so T2 can be judged */
  tm485_timing_class timing;
  uint8_t reserved[6];
} tm485_port_capability;

/* How far the last request has got. */
typedef uint8_t tm485_transmission_state;
enum {
  TM485_TRANSMISSION_IDLE,    /* nothing was sent yet */
  TM485_TRANSMISSION_SENDING, /* bytes or the driver are still on the line */
  TM485_TRANSMISSION_SENT,    /* complete: see the contract above */
  TM485_TRANSMISSION_FAILED   /* the port gave up */
};

/* What try_receive found. */
typedef struct tm485_reception {
  tm485_time first_start; /* start bit of the first byte; only with wire_timestamps */
  uint32_t count;         /* bytes written to the buffer; 0: nothing yet */
  tm485_errc fault;       /* TM485_OK, _OVERRUN, _FRAMING_ERROR or _PORT_GONE, seen since the last call */
  uint16_t reserved;
} tm485_reception;

/* The functions. None may be NULL; `context` is for their own use. The table must outlive the bus; it may be a constant
   in flash. What a function answers that makes no sense (more bytes than asked for, a code that is none, an
   instant more than an hour away) ends the exchange with TM485_ERR_PORT_GONE. */
typedef struct tm485_port {
  void* context;
  void (*capability)(void* context, tm485_port_capability* capability);
  /* Starts a request of 1..4 bytes, at `now` or as soon after as the port can. Sets `start` to the instant of the first
     start bit: exact with wire_timestamps, otherwise the port's estimate. Answers TM485_OK, TM485_ERR_SEND_FAILED or
     TM485_ERR_PORT_GONE. `start` holds `now` on entry. */
  tm485_errc (*try_send)(void* context, const uint8_t* request, size_t count, tm485_time now,
                         tm485_time* start);
  /* How far the last request has got at `now`. With TM485_TRANSMISSION_FAILED set `fault`; it is TM485_OK on entry. */
  tm485_transmission_state (*transmission)(void* context, tm485_time now, tm485_errc* fault);
  /* Takes what has been received until `now`, at most `size` bytes. `reception` is all zero on entry. */
  void (*try_receive)(void* context, uint8_t* buffer, size_t size, tm485_time now,
                      tm485_reception* reception);
} tm485_port;

#ifdef __cplusplus
}
#endif
