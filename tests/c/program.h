/* A C program that uses the whole interface, in steps that a test calls. Each answers 0, or the line that failed. */
#pragma once

#include "tm485/c/tm485.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The line as the steps see it. */
typedef struct test_line {
  tm485_port port;
  tm485_time (*next_event)(
      void* context); /* when the next character comes; TM485_NEVER: none is on its way */
  void* context;
} test_line;

#define CHECK(condition)               \
  do {                                 \
    if (!(condition)) return __LINE__; \
  } while (0)

/* What tm485_design solves for 62.5 us, three states, 1 kHz. */
extern const tm485_estimator_gains kGains;

/* Time of the next step: whatever is due first, but no more than 1 ms. */
tm485_time next_time(const test_line* line, tm485_time now, tm485_time due);

typedef struct collected {
  tm485_sample samples[2000];
  size_t count;
  tm485_statistics statistics;
  tm485_record record;
} collected;
/* Start-up, then every new sample in one's own array. */
int use_bus(const test_line* line, const char* preset, tm485_data_id id, tm485_time slot, size_t samples,
            collected* to);
/* Patterns, refusals, background exchanges, restart. */
int use_patterns(const test_line* line);
/* Start-up fails: the encoder never answers. */
int use_dead_line(const test_line* line);
/* A port that answers nonsense. */
int use_bad_port(void);

/* Set-up with arguments that cannot be. */
int use_wrong_arguments(const test_line* line);
int use_texts(void);
int use_profiles(void);
int use_codec(void);
int use_estimators(tm485_estimate* estimate, tm485_fixed_estimate* fixed);

/* The loop's own account of an axis whose line is cut from `cut` to `mended`. */
typedef struct loop_account {
  unsigned fresh, extrapolated, invalid;
  unsigned raised; /* calls of on_invalid */
  tm485_time raised_at;
  tm485_time resumed_at;
  double largest_error; /* of the estimate, counts */
  tm485_statistics statistics;
} loop_account;
int use_axis(const test_line* line, tm485_time cut, tm485_time mended, double counts_per_second,
             loop_account* account);
int use_axis_commands(const test_line* line);

/* Writes, reads and verifies 40 bytes across a page's border. `knows`: with an image of what is known. */
int use_eeprom(const test_line* line, const char* preset, bool knows, bool in_axis);
int use_reset(const test_line* line, tm485_reset_kind kind, tm485_reset_outcome* outcome);

#ifdef __cplusplus
}
#endif
