/* Samples and statistics: what a bus tells. Plain data, copied out whole. Specification: sections 3 and 4. */
#pragma once

#include "tm485/c/base.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef uint8_t tm485_quality;
enum {
  TM485_QUALITY_INVALID,      /* nothing known, or held for too long */
  TM485_QUALITY_HELD,         /* the last good sample; this cycle brought none */
  TM485_QUALITY_EXTRAPOLATED, /* computed for a later instant than its latch time */
  TM485_QUALITY_FRESH         /* from this cycle's reply */
};

/* What the status bits mean by the profile's policy. */
typedef uint8_t tm485_alarm;
enum { TM485_ALARM_NONE, TM485_ALARM_WARNING, TM485_ALARM_FAULT };

/* One position of the shaft, with everything needed to judge it. */
typedef struct tm485_sample {
  int64_t position;              /* motor counts: direction, zero offset and reference turn applied */
  tm485_time latch_time;         /* when the encoder latched it */
  uint32_t sequence;             /* counts samples, fresh, held or invalid; wraps */
  uint32_t single_turn;          /* ABS as sent */
  int32_t turns;                 /* the encoder's turn count, as of the last reply that had one */
  uint32_t electrical_angle;     /* 2^32 is one electrical turn */
  uint32_t latch_uncertainty_ns; /* +- of the latch time */
  uint32_t announced_hold_ns;    /* an EEPROM write is about to take the line for so long; 0: none */
  uint32_t half_width;      /* by how many counts position can be wrong, undetected wrong bits included */
  uint32_t discontinuities; /* a new number: the shaft was found where it cannot have come to; wraps */
  tm485_status status;      /* SF and ALMC */
  uint8_t enid;             /* as of the last reply that had one */
  tm485_data_id id;         /* of the reply that it came from */
  tm485_quality quality;
  tm485_alarm alarm;
  uint8_t referenced;   /* 0 until the axis is homed, or the encoder kept its turns over a power-off */
  uint8_t has_position; /* 0: ID1 or ID2, whose replies have none */
} tm485_sample;

/* Minimum, mean, maximum and sixteen bins of a time; bin n begins at origin + n * 2^shift ns. */
#define TM485_BINS 16
typedef struct tm485_time_statistic {
  tm485_time minimum; /* the three are 0 while count is 0 */
  tm485_time mean;
  tm485_time maximum;
  tm485_time origin;
  uint32_t bins[TM485_BINS]; /* what lies outside counts in the first or last */
  uint32_t count;
  uint32_t shift;
} tm485_time_statistic;

/* Error codes to come find room here. */
#define TM485_ERRC_ROOM 48

/* Everything that a bus counts since it was made. Counters saturate. */
typedef struct tm485_statistics {
  uint32_t cycles;       /* cyclic slots that were used: good + failed */
  uint32_t good;         /* cyclic replies that became a fresh sample */
  uint32_t failed;       /* cyclic slots that did not */
  uint32_t slips;        /* free grid: starts later than the jitter margin, which moved it */
  uint32_t skipped;      /* phase-locked grid: slots that were missed and left out */
  uint32_t background;   /* background exchanges, good or failed */
  uint32_t stolen;       /* cyclic slots that went to a background exchange */
  uint32_t displaced;    /* cyclic slots that went to resets, or to an EEPROM write that holds the bus */
  uint32_t starved;      /* background requests that waited too long and ended with TM485_ERR_NO_GAP */
  uint32_t longest_wait; /* of a background request, in cyclic slots */
  uint32_t startups;     /* start-up sequences that succeeded */
  uint32_t startup_failures;
  uint32_t lost;                    /* times that the encoder was given up and start-up began again */
  uint32_t restarts;                /* restart events */
  uint32_t invalidated;             /* times that a sample became too old */
  uint32_t discontinuities;         /* times that the shaft was found where it cannot have come to */
  uint32_t stray_bytes;             /* bytes that belonged to no exchange */
  uint32_t reserved_status;         /* good replies with a status bit that the profile calls reserved */
  uint32_t warnings;                /* good replies with TM485_ALARM_WARNING */
  uint32_t faults;                  /* good replies with TM485_ALARM_FAULT */
  uint32_t servo_ticks;             /* ticks of the servo clock that came */
  uint32_t servo_locks;             /* times that the grid was moved to the servo clock's phase */
  uint32_t errors[TM485_ERRC_ROOM]; /* every failure, in any phase, by cause; 0 from TM485_ERRC_COUNT on */
  tm485_time_statistic t1;          /* request start to request start of the cycle */
  tm485_time_statistic reply_delay; /* T2 with wire timestamps, otherwise what the host has seen of it */
  tm485_time_statistic servo_phase; /* servo tick less where the grid expected it, once locked */
} tm485_statistics;

/* Age of a sample's data at `now`. Any. */
static inline tm485_time tm485_sample_age(const tm485_sample* sample, tm485_time now) {
  return now - sample->latch_time;
}

#ifdef __cplusplus
}
#endif
