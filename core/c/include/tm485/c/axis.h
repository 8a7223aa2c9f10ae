/* The axis: a bus with all that a servo loop needs around it: estimator, validity, commands.

   Two contexts. The bus's context (a real-time thread, a timer interrupt) calls tm485_axis_*; the servo loop's context
   calls tm485_loop_*, and neither waits for the other. tm485_loop_statistics() is for any thread. Handles must not be NULL
   and must have been initialised; only tm485_axis_init() looks. Specification: sections 2 to 4; docs/servo-loop.md. */
#pragma once

#include "tm485/c/base.h"
#include "tm485/c/bus.h"
#include "tm485/c/estimator.h"
#include "tm485/c/sample.h"

#ifdef __cplusplus
extern "C" {
#endif

/* An axis, in storage of the caller's. It must stay where it is. */
#if UINTPTR_MAX > 0xFFFFFFFFu
#define TM485_AXIS_SIZE 6272
#define TM485_AXIS_ALIGNMENT 64
#elif defined(__ARM_ARCH_PROFILE) && __ARM_ARCH_PROFILE == 'M'
#define TM485_AXIS_SIZE 4672
#define TM485_AXIS_ALIGNMENT 8
#else
#define TM485_AXIS_SIZE 6208
#define TM485_AXIS_ALIGNMENT 64
#endif
typedef union tm485_axis {
  TM485_ALIGNAS(TM485_AXIS_ALIGNMENT) unsigned char storage[TM485_AXIS_SIZE];
} tm485_axis;
/* What the library needs; not more than TM485_AXIS_SIZE. Any. */
size_t tm485_axis_size(void);

/* Take the default, change, init. Copied there. */
typedef struct tm485_axis_setup {
  tm485_bus_config bus;
  tm485_time statistics_every;        /* how old statistics in other threads may be */
  const tm485_estimator_gains* gains; /* must outlive the axis; NULL: no estimator */
  void (*on_invalid)(void* context,
                     tm485_time now); /* torque off; called in the bus's context; NULL: nobody */
  void* on_invalid_context;
} tm485_axis_setup;

/* As tm485_bus_config_default(); no estimator, statistics every millisecond. Any; constant time. */
void tm485_axis_setup_default(tm485_axis_setup* setup);

/* ---- The bus's context ---- */

/* As tm485_bus_init(). TM485_ERR_BAD_ARGUMENT also for gains that cannot be used. */
TM485_NODISCARD tm485_errc tm485_axis_init(tm485_axis* axis, const tm485_port* port,
                                           const tm485_profile* profile, const tm485_axis_setup* setup);
/* As tm485_bus_check() and tm485_bus_start(). */
TM485_NODISCARD tm485_errc tm485_axis_check(const tm485_axis* axis, tm485_feasibility* feasibility,
                                            tm485_refusal* refusal);
TM485_NODISCARD tm485_errc tm485_axis_start(tm485_axis* axis, tm485_time now, tm485_refusal* refusal);
/* Sends nothing more; what the loop reads becomes invalid, commands end with TM485_ERR_BAD_STATE. */
void tm485_axis_stop(tm485_axis* axis, tm485_time now);
/* Does what is due at `now`, takes commands and tells the loop; answers when to call again at the latest. Bounded as
   tm485_bus_poll(), and by TM485_AXIS_COMMANDS. */
tm485_time tm485_axis_poll(tm485_axis* axis, tm485_time now);
/* The bus inside: for EEPROM tasks, reset runs, records, statistics, state. Its samples and completions are the axis's:
   not tm485_bus_latest(), _take_completion(), _start(), _stop() or _poll() on it. */
tm485_bus* tm485_axis_bus(tm485_axis* axis);

/* ---- The servo loop's context; constant time, wait-free ---- */

typedef uint8_t tm485_validity;
enum {
  TM485_VALIDITY_INVALID,      /* do not use: no sample yet, or it was lost and nobody has resumed */
  TM485_VALIDITY_EXTRAPOLATED, /* the newest reply is missing; use the estimate, not for long */
  TM485_VALIDITY_FRESH         /* the newest reply is here */
};

/* The newest sample, and whether it may be used at `now`; `sample` may be NULL. Invalid is latched: only the command
   TM485_COMMAND_RESUME leaves it. */
tm485_validity tm485_loop_read(tm485_axis* axis, tm485_time now, tm485_sample* sample);
/* What the shaft does at `time`, from the samples up to the last tm485_loop_read(). State TM485_ESTIMATOR_EMPTY if the
   axis has no estimator or there was no sample. */
void tm485_loop_estimate_at(const tm485_axis* axis, tm485_time time, tm485_estimate* estimate);

/* The axis as of the last tm485_loop_read(). */
typedef struct tm485_loop_view {
  tm485_time fresh_until;   /* later the next sample is overdue */
  tm485_time valid_until;   /* later even the extrapolated one is too old */
  tm485_errc startup_cause; /* why the last start-up sequence failed */
  tm485_bus_state state;
  tm485_startup_stage stage;
  uint8_t valid;   /* 0: no sample yet, or invalid is latched */
  uint8_t latched; /* it was lost: resume, if the loop means to go on */
  tm485_link_state link;
  tm485_alarm alarm; /* of the latched status bits: tm485_bus_alarms() */
} tm485_loop_view;
void tm485_loop_get_view(const tm485_axis* axis, tm485_loop_view* view);

/* The servo clock ticked at `tick` (TM485_PHASE_SERVO). Only the newest tick counts. */
void tm485_loop_servo_tick(tm485_axis* axis, tm485_time tick);

typedef uint8_t tm485_command;
enum {
  TM485_COMMAND_EXCHANGE, /* a request, in the background of the cycle */
  TM485_COMMAND_RESUME, /* leave the latched invalid state; TM485_ERR_BAD_STATE while no good sample comes */
  TM485_COMMAND_SET_REFERENCED, /* the axis was homed; TM485_ERR_BAD_STATE during start-up */
  TM485_COMMAND_UNREFERENCE,    /* the axis is no longer homed; likewise */
  TM485_COMMAND_RESTART         /* the encoder was restarted: begin with start-up again */
};
/* How many commands may be under way. */
#define TM485_AXIS_COMMANDS 8

/* How a command ended. Each posted command has exactly one. */
typedef struct tm485_command_result {
  tm485_request request; /* of an exchange */
  tm485_reply reply;     /* if has_reply */
  uint32_t ticket;       /* as answered by tm485_loop_post() */
  tm485_errc error;
  tm485_command command;
  uint8_t has_reply;
} tm485_command_result;

/* Sends a command to the bus; `request` is of TM485_COMMAND_EXCHANGE, else ignored. `ticket` may be NULL.
   TM485_ERR_BUSY: TM485_AXIS_COMMANDS are under way, take results first. TM485_ERR_BAD_ARGUMENT: no such command, or an
   exchange whose bytes are no request. */
TM485_NODISCARD tm485_errc tm485_loop_post(tm485_axis* axis, tm485_command command,
                                           const tm485_request* request, uint32_t* ticket);
/* The result of a command, once; false if there is none. Not always in the order of posting. */
bool tm485_loop_poll_completion(tm485_axis* axis, tm485_command_result* result);

/* ---- Any thread ---- */

/* Statistics as of the last publication. False if the bus was writing them each time that they were looked at, and
   before the first publication: ask again later. */
bool tm485_loop_statistics(const tm485_axis* axis, tm485_statistics* statistics);

#ifdef __cplusplus
}
#endif
