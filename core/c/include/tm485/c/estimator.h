/* Estimators: position, velocity and acceleration at any instant, from positions with their latch times; in float, and
   in integers for cores without a floating-point unit. docs/estimator.md has the model, units and figures.

   Their gains are constants: a host's program solves them once (library tm485::design, which needs C++ and Eigen) and
   prints them; a firmware keeps them in flash. They are used in place and must outlive what uses them. One owner each;
   every function: constant time. Handles must not be NULL and must have been initialised; only the init functions look. */
#pragma once

#include "tm485/c/base.h"
#include "tm485/c/sample.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The unit of time is the nominal period: velocity in counts per period, acceleration in counts per period squared. */
typedef struct tm485_estimator_gains {
  tm485_time period;   /* nominal distance of two samples; 1 us to 33 ms */
  uint8_t order;       /* 2 (position, velocity) or 3 (and acceleration) */
  uint8_t longest_gap; /* after more periods without a sample start anew; 2 to 32 */
  uint8_t reserved[2];
  float gain_position; /* of the steady state: what one count of innovation adds */
  float gain_velocity;
  float gain_acceleration;
  float covariance_pp; /* of the steady state, after a sample */
  float covariance_pv;
  float covariance_pa;
  float covariance_vv;
  float covariance_va;
  float covariance_aa;
  float process_noise;         /* density, counts^2 per period^(2 order - 1) */
  float measurement_variance;  /* of one sample, counts^2 */
  float acceleration_variance; /* at a start, (counts per period^2)^2; 0: at rest or at constant speed */
  float reserved_float;
} tm485_estimator_gains;

/* True if the gains can be used: orders, ranges and signs. Any; constant time. */
bool tm485_estimator_gains_valid(const tm485_estimator_gains* gains);

/* Where an estimator stands. An estimate means something from TM485_ESTIMATOR_TRACKING upwards. */
typedef uint8_t tm485_estimator_state;
enum {
  TM485_ESTIMATOR_EMPTY,    /* no sample yet, or reset */
  TM485_ESTIMATOR_STARTING, /* one sample: a position, no velocity */
  TM485_ESTIMATOR_LOST,     /* no sample for longer than the longest gap; the next one starts anew */
  TM485_ESTIMATOR_TRACKING, /* the last update brought a sample */
  TM485_ESTIMATOR_BRIDGING  /* a sample is missing; the estimate goes on with growing variance */
};

/* What the shaft does at `time`. */
typedef struct tm485_estimate {
  tm485_time time;
  int64_t position;        /* counts, rounded down */
  float fraction;          /* of a count, 0 to 1, to be added to `position` */
  float velocity;          /* counts/s */
  float acceleration;      /* counts/s^2; 0 with two states */
  float position_variance; /* counts^2; infinite if it is beyond float */
  float velocity_variance; /* (counts/s)^2 */
  tm485_estimator_state state;
  uint8_t reserved[3];
} tm485_estimate;

/* The estimate less a count, exact near it: what a position loop subtracts. Saturates at +-2^30 counts. Any. */
float tm485_estimate_from(const tm485_estimate* estimate, int64_t reference);
/* True if the estimate means something. Any. */
static inline bool tm485_estimate_valid(const tm485_estimate* estimate) {
  return estimate->state >= TM485_ESTIMATOR_TRACKING;
}

/* The estimator in float, in storage of the caller's. */
#if UINTPTR_MAX > 0xFFFFFFFFu
#define TM485_ESTIMATOR_SIZE 128
#else
#define TM485_ESTIMATOR_SIZE 128
#endif
typedef union tm485_estimator {
  uint64_t align;
  unsigned char storage[TM485_ESTIMATOR_SIZE];
} tm485_estimator;
/* What the library needs; not more than TM485_ESTIMATOR_SIZE. Any. */
size_t tm485_estimator_size(void);

/* TM485_ERR_BAD_ARGUMENT: NULL, gains that cannot be used, storage that is not aligned. */
TM485_NODISCARD tm485_errc tm485_estimator_init(tm485_estimator* estimator,
                                                const tm485_estimator_gains* gains);
/* A position, in counts, that was latched at `latch`. Answers the state afterwards. */
tm485_estimator_state tm485_estimator_update(tm485_estimator* estimator, int64_t position, tm485_time latch);
/* A fresh sample with a position is an update; any other is ignored (tell tm485_estimator_miss()). */
tm485_estimator_state tm485_estimator_update_sample(tm485_estimator* estimator, const tm485_sample* sample);
/* No sample of `latch` will come. */
tm485_estimator_state tm485_estimator_miss(tm485_estimator* estimator, tm485_time latch);
/* The estimate at `time`, meant for a few periods around the last sample. */
void tm485_estimator_at(const tm485_estimator* estimator, tm485_time time, tm485_estimate* estimate);
/* Forgets everything. */
void tm485_estimator_reset(tm485_estimator* estimator);
/* Measured less predicted position of the last update, in counts. */
float tm485_estimator_innovation(const tm485_estimator* estimator);

/* The gains of the estimator in integers. */
typedef struct tm485_fixed_gains {
  struct {
    int32_t position; /* 2^30 is 1; likewise the others */
    int32_t velocity;
    int32_t acceleration;
  } correction[16];        /* [0]: steady state; [n]: the first sample after n missing ones */
  uint32_t variance[33];   /* so many periods after a sample of the steady state; 2^12 is 1 count^2 */
  uint32_t periods_per_ns; /* times a span in ns, shifted right by `shift`: periods, 2^26 is 1 */
  uint32_t shift;
  uint32_t rate;       /* periods per second, 2^8 is 1 */
  uint32_t recovery;   /* what a sample leaves of the age that a gap brought; 2^16 is 1 */
  int32_t period;      /* ns */
  int32_t longest_gap; /* ns */
} tm485_fixed_gains;

/* From the gains in float: on the host, or once at start-up (double precision). TM485_ERR_BAD_ARGUMENT: gains that cannot
   be used, or NULL. */
TM485_NODISCARD tm485_errc tm485_fixed_gains_make(tm485_fixed_gains* fixed,
                                                  const tm485_estimator_gains* gains);

/* What the shaft does at `time`, in integers. */
typedef struct tm485_fixed_estimate {
  tm485_time time;
  int64_t position;     /* counts, rounded down */
  int64_t velocity;     /* counts/s, 2^8 is 1 */
  int64_t acceleration; /* counts/s^2 */
  uint32_t fraction;    /* 2^32 is one count, to be added to `position` */
  uint32_t variance;    /* of the position: 2^12 is 1 count^2; all ones: unknown */
  tm485_estimator_state state;
  uint8_t reserved[7];
} tm485_fixed_estimate;

/* The estimator in integers, in storage of the caller's. */
#define TM485_FIXED_ESTIMATOR_SIZE 64
typedef union tm485_fixed_estimator {
  uint64_t align;
  unsigned char storage[TM485_FIXED_ESTIMATOR_SIZE];
} tm485_fixed_estimator;
/* What the library needs; not more than TM485_FIXED_ESTIMATOR_SIZE. Any. */
size_t tm485_fixed_estimator_size(void);

/* TM485_ERR_BAD_ARGUMENT: NULL, or storage that is not aligned. The gains are not looked at: take those that
   tm485_fixed_gains_make() has made. */
TM485_NODISCARD tm485_errc tm485_fixed_estimator_init(tm485_fixed_estimator* estimator,
                                                      const tm485_fixed_gains* gains);
/* As those of tm485_estimator. */
tm485_estimator_state tm485_fixed_estimator_update(tm485_fixed_estimator* estimator, int64_t position,
                                                   tm485_time latch);
tm485_estimator_state tm485_fixed_estimator_update_sample(tm485_fixed_estimator* estimator,
                                                          const tm485_sample* sample);
tm485_estimator_state tm485_fixed_estimator_miss(tm485_fixed_estimator* estimator, tm485_time latch);
void tm485_fixed_estimator_at(const tm485_fixed_estimator* estimator, tm485_time time,
                              tm485_fixed_estimate* estimate);
void tm485_fixed_estimator_reset(tm485_fixed_estimator* estimator);

#ifdef __cplusplus
}
#endif
