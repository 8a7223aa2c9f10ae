/* The bus: one encoder on one line, read every cycle. Specification: sections 2 to 4.

   The owner calls tm485_bus_poll() whenever something may have happened (a timer, a received byte, or in a loop) and
   gets back when to call it at the latest. Everything else follows from that:

     start-up -> cyclic reads -> (lost, or on_restart) -> start-up ...

   Context: every function but tm485_bus_latest() belongs to the one context that owns the bus, a thread or an interrupt
   priority; tm485_bus_latest() belongs to one reader context of any priority. Handles must not be NULL, and must have been
   initialised; only tm485_bus_init() looks. A servo loop in a context of its own wants axis.h instead. */
#pragma once

#include "tm485/c/base.h"
#include "tm485/c/codec.h"
#include "tm485/c/port.h"
#include "tm485/c/profile.h"
#include "tm485/c/sample.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A bus, in storage of the caller's. It must stay where it is. */
#if UINTPTR_MAX > 0xFFFFFFFFu
#define TM485_BUS_SIZE 2624
#define TM485_BUS_ALIGNMENT 64
#elif defined(__ARM_ARCH_PROFILE) && __ARM_ARCH_PROFILE == 'M'
#define TM485_BUS_SIZE 2304
#define TM485_BUS_ALIGNMENT 8
#else
#define TM485_BUS_SIZE 2624
#define TM485_BUS_ALIGNMENT 64
#endif
typedef union tm485_bus {
  TM485_ALIGNAS(TM485_BUS_ALIGNMENT) unsigned char storage[TM485_BUS_SIZE];
} tm485_bus;
/* What the library needs; not more than TM485_BUS_SIZE. Any. */
size_t tm485_bus_size(void);

/* One request of a pattern; `slots` beyond the first are a declared gap behind it. */
#define TM485_MAX_STEPS 32
typedef struct tm485_step {
  tm485_data_id id; /* ID0, ID1, ID2 or ID3 */
  uint8_t slots;    /* 1 or more */
} tm485_step;

/* When the pattern starts. */
typedef uint8_t tm485_phase;
enum {
  TM485_PHASE_ANY,   /* at once */
  TM485_PHASE_EPOCH, /* the first step's latches fall on `epoch` + n times the pattern's length */
  TM485_PHASE_SERVO  /* latched `servo_lead` before the ticks of a servo clock: tm485_bus_on_servo_tick() */
};

/* What a bus does: take the default, change, init. Copied there. Flags are 0 or 1. */
typedef struct tm485_bus_config {
  tm485_axis_config axis;
  tm485_time slot;         /* request start to request start; 0: the shortest possible */
  tm485_time epoch;        /* with TM485_PHASE_EPOCH */
  tm485_time servo_period; /* with TM485_PHASE_SERVO */
  tm485_time servo_lead;   /* likewise */
  tm485_time max_hold;     /* a sample is invalid when its successor is overdue by this */
  tm485_time
      lost_after; /* start-up begins again after failed cycles that last this long; 0: by the profile */
  tm485_step steps[TM485_MAX_STEPS]; /* what is read, over and over */
  uint8_t step_count;                /* 0: no cycle, only background exchanges */
  tm485_phase phase;
  /* N: a background request that fits no gap, or has not fitted one for 32 slots, takes one slot in N; 0: it is refused */
  uint16_t steal_every;
  uint8_t eeprom_may_hold; /* 1: EEPROM writes that hold the bus are sent, the sample is held meanwhile */
  uint8_t startup_frames;  /* mutually consistent frames before anything is fresh */
  uint16_t link_window;    /* cycles over which failures are counted, 1 or more */
  uint16_t degraded_at;    /* failed ones among them that make the link degraded, 1 or more */
  uint16_t good_below;     /* a window with fewer makes it good again; 1 to degraded_at */
  uint8_t link_lost_after; /* failed cycles in a row that make it lost, 1 or more */
  uint8_t alarm_debounce;  /* replies in a row that must agree on a status bit, 1 to 4 */
  uint8_t reserved[2];
} tm485_bus_config;

/* ID3 in every slot, as fast as it goes; held for 2 ms at most. Any; constant time. */
void tm485_bus_config_default(tm485_bus_config* config);
/* One ID in every slot of `slot`. Any; constant time. */
void tm485_bus_config_cycle(tm485_bus_config* config, tm485_data_id id, tm485_time slot);
/* `times` more requests of an ID, each in `slots` slots; the first call after setting step_count to 0 begins a pattern.
   Beyond TM485_MAX_STEPS step_count becomes TM485_MAX_STEPS + 1, which tm485_bus_init() refuses. Any. */
void tm485_bus_config_add(tm485_bus_config* config, tm485_data_id id, uint8_t times, uint8_t slots);

/* Why a pattern is impossible, and the nearest that is possible. */
typedef struct tm485_refusal {
  tm485_time
      nearest; /* the shortest slot (TM485_ERR_LEAD_TOO_SHORT: lead) that would be accepted; 0: none would help */
  tm485_errc code;
  uint8_t step; /* which step of the pattern it is about */
  uint8_t reserved[5];
} tm485_refusal;

/* What an accepted pattern leaves. */
typedef struct tm485_feasibility {
  tm485_time slot;      /* as given, or the shortest possible */
  tm485_time length;    /* of the whole pattern */
  tm485_time slack;     /* how late a request may be without delaying the next */
  tm485_time gap;       /* longest background exchange that a gap holds; 0: none does */
  tm485_time ready;     /* from the latch to the sample, at the latest, without the port's latency */
  uint8_t free_running; /* a late start moves the grid */
  uint8_t reserved[7];
} tm485_feasibility;

typedef uint8_t tm485_bus_state;
enum { TM485_STATE_STOPPED, TM485_STATE_STARTUP, TM485_STATE_RUNNING };

typedef uint8_t tm485_startup_stage;
enum {
  TM485_STAGE_QUIET,
  TM485_STAGE_ANSWER,
  TM485_STAGE_IDENTIFY,
  TM485_STAGE_CROSS_CHECK,
  TM485_STAGE_CONSISTENT,
  TM485_STAGE_DONE
};

/* A finished background exchange. */
typedef struct tm485_completion {
  tm485_request request;
  tm485_reply
      reply; /* if has_reply: with TM485_OK, TM485_ERR_EEPROM_BUSY and TM485_ERR_EEPROM_ADDRESS_MISMATCH */
  uint32_t ticket; /* as offered */
  tm485_errc error;
  uint8_t has_reply;
  uint8_t reserved;
} tm485_completion;

/* How good the line is: degraded and lost by the limits of tm485_bus_config. */
typedef uint8_t tm485_link_state;
enum { TM485_LINK_GOOD, TM485_LINK_DEGRADED, TM485_LINK_LOST };
/* Failed cycles of the last whole window, by who is to blame. */
typedef struct tm485_link_health {
  uint16_t silence;     /* no reply */
  uint16_t damage;      /* bytes that are no frame */
  uint16_t implausible; /* frames that cannot be true */
  uint16_t host;        /* the port, or an owner that came too late */
  tm485_link_state state;
  uint8_t measured; /* 0: no whole window has passed, the counts say nothing */
} tm485_link_health;

/* SF and ALMC over time. Latched bits are cleared by a reset run that was read back, and by nothing else. */
typedef struct tm485_alarms {
  tm485_status live;
  tm485_status latched;
  tm485_alarm live_level; /* by the profile's policy */
  tm485_alarm latched_level;
} tm485_alarms;

/* The last exchange, for whoever records every cycle. */
typedef uint8_t tm485_record_kind;
enum { TM485_RECORD_STARTUP, TM485_RECORD_CYCLIC, TM485_RECORD_BACKGROUND };
typedef struct tm485_record {
  tm485_time slot;        /* when a cyclic request was due */
  tm485_time start;       /* when it started */
  tm485_time seen;        /* when its verdict was known */
  tm485_time reply_delay; /* T2, or what the host has seen of it */
  tm485_errc result;
  tm485_record_kind kind;
  tm485_data_id id;
  uint8_t has_reply_delay;
  uint8_t reserved[3];
} tm485_record;

/* Makes a bus in `bus`; sends nothing. `port` and `profile` must outlive it, `config` is copied. Nothing of an earlier
   bus in the same storage is kept. Owner. TM485_ERR_BAD_ARGUMENT: NULL, a port without one of its functions, storage
   that is not aligned, a config with a value that is none (an ID, a phase, units, more steps than TM485_MAX_STEPS). */
TM485_NODISCARD tm485_errc tm485_bus_init(tm485_bus* bus, const tm485_port* port,
                                          const tm485_profile* profile, const tm485_bus_config* config);

/* Can the pattern be kept with this profile and port? Sends nothing, changes nothing. On TM485_OK `feasibility` is set
   (all 0 without a pattern), otherwise `refusal`; either may be NULL. Owner; bounded by the pattern. Errors:
   TM485_ERR_BAD_ARGUMENT (also a span of the config or of the port below zero or above an hour), _PERIOD_BELOW_T1, _PERIOD_BELOW_PORT, _POSITION_LOST, _SERVO_MISMATCH, _LEAD_TOO_SHORT. */
TM485_NODISCARD tm485_errc tm485_bus_check(const tm485_bus* bus, tm485_feasibility* feasibility,
                                           tm485_refusal* refusal);
/* As tm485_bus_check(), and begins start-up; a bus that runs begins anew. On a refusal nothing has changed. Owner. */
TM485_NODISCARD tm485_errc tm485_bus_start(tm485_bus* bus, tm485_time now, tm485_refusal* refusal);
/* Sends nothing more. Owner. */
void tm485_bus_stop(tm485_bus* bus);

/* Does what is due at `now`; answers when to call again at the latest, TM485_NEVER when stopped. Earlier is always
   allowed. `now` never goes back. Owner; bounded: at most one request and one reply. */
tm485_time tm485_bus_poll(tm485_bus* bus, tm485_time now);
/* The encoder was restarted: start-up begins again. Owner. */
void tm485_bus_on_restart(tm485_bus* bus, tm485_time now);
/* A tick of the servo clock, stamped at `tick`; ignored without TM485_PHASE_SERVO, and before the start. Owner. */
void tm485_bus_on_servo_tick(tm485_bus* bus, tm485_time tick);

/* The newest sample. The one function for the reader's context; wait-free, constant time. */
void tm485_bus_latest(tm485_bus* bus, tm485_sample* sample);

/* Asks for one background exchange; it always ends in a completion, which tm485_bus_take_completion() gives once. One of
   each class (resets, EEPROM, anything else) can wait. `ticket` is for the caller's own use; from 0xFFFFFF00 on they are
   the library's. Owner. TM485_ERR_BAD_STATE before start-up is through, _BUSY while one of its class is pending or its
   completion was not taken, _NO_GAP if the pattern has no room for it, _BAD_ARGUMENT if its bytes are no request. */
TM485_NODISCARD tm485_errc tm485_bus_offer(tm485_bus* bus, const tm485_request* request, uint32_t ticket);
/* A completion, once, the most urgent class first; false if there is none. Not beside an axis, and not while an EEPROM
   task or a reset run is active: those take their own. Owner. */
bool tm485_bus_take_completion(tm485_bus* bus, tm485_completion* completion);

/* What follows is constant time, for the owner. */

/* When the successor of the newest fresh sample is overdue. */
tm485_time tm485_bus_fresh_until(const tm485_bus* bus);
/* Until when the newest sample may be used, extrapolated; TM485_NEVER: there is none. */
tm485_time tm485_bus_valid_until(const tm485_bus* bus);
/* While an exchange is under way: when its reply can be complete at the earliest. Otherwise TM485_NEVER. */
tm485_time tm485_bus_reply_expected(const tm485_bus* bus);
/* The axis was homed: samples are referenced from the next one on. */
void tm485_bus_set_referenced(tm485_bus* bus, bool referenced);
tm485_bus_state tm485_bus_get_state(const tm485_bus* bus);
tm485_startup_stage tm485_bus_startup_stage(const tm485_bus* bus);
/* Why and where the last start-up sequence failed; TM485_OK if none has since the last good one. `stage` may be NULL. */
tm485_errc tm485_bus_startup_error(const tm485_bus* bus, tm485_startup_stage* stage);
void tm485_bus_link(const tm485_bus* bus, tm485_link_health* health);
void tm485_bus_alarms(const tm485_bus* bus, tm485_alarms* alarms);
/* All statistics. The means divide 64-bit numbers, so not in the cycle of a small core. */
void tm485_bus_statistics(const tm485_bus* bus, tm485_statistics* statistics);
/* One of its error counts; 0 for a code that is none. */
uint32_t tm485_bus_error_count(const tm485_bus* bus, tm485_errc code);
/* The last exchange; answers how many there were, so that a recorder knows whether it is new. `record` may be NULL. */
uint32_t tm485_bus_last_record(const tm485_bus* bus, tm485_record* record);

#ifdef __cplusplus
}
#endif
