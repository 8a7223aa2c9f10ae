/* Reset runs: ten identical reset requests in a row, and the proof that they did what they should. Specification:
   section 6.

   Context: the bus's. Every function: constant time. Handles must not be NULL and must have been initialised; only
   tm485_reset_init() looks. */
#pragma once

#include "tm485/c/base.h"
#include "tm485/c/bus.h"
#include "tm485/c/profile.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A run, in storage of the caller's. It must stay where it is. */
#define TM485_RESET_SIZE 144
typedef union tm485_reset {
  uint64_t align;
  unsigned char storage[TM485_RESET_SIZE];
} tm485_reset;
/* What the library needs; not more than TM485_RESET_SIZE. Any. */
size_t tm485_reset_size(void);

typedef uint8_t tm485_reset_kind;
enum {
  TM485_RESET_ERRORS, /* ID7: latched error bits */
  TM485_RESET_ZERO, /* ID8: the present single-turn position becomes zero; the motor's alignment moves with it */
  TM485_RESET_MULTI_TURN /* IDC: error bits and the turn count */
};

typedef uint8_t tm485_reset_verdict;
enum {
  TM485_VERDICT_VERIFIED,       /* done, and read back */
  TM485_VERDICT_CAUSE_PERSISTS, /* done, but `persisting` bits are set again or still: their cause lasts */
  TM485_VERDICT_REFUSED,        /* not begun, or begun without effect: `code` says why */
  TM485_VERDICT_FAILED          /* the line failed; what the encoder did is not known */
};

typedef struct tm485_reset_outcome {
  uint32_t abs_before; /* what ID3 said before and after */
  uint32_t abs_after;
  int32_t turns_before;
  int32_t turns_after;
  tm485_status status_before;
  tm485_status status_after;
  tm485_status persisting; /* error bits that are set again or still */
  tm485_errc code; /* refused: TM485_ERR_SHAFT_MOVES, _BUSY, _RESET_WITHOUT_EFFECT; failed: the last error */
  tm485_reset_verdict verdict;
  uint8_t runs; /* that were begun: more than one after an interruption */
  uint8_t reserved[2];
} tm485_reset_outcome;

typedef struct tm485_reset_config {
  tm485_time window;   /* zero: the shaft stands still if it moves by no more than `standstill` over this */
  uint32_t standstill; /* counts; 0: 2^-15 of a turn, at least 2 */
  uint32_t tolerance;  /* zero: read back within this of 0, in counts; 0: four times `standstill` */
  uint8_t most_runs;   /* a run that was interrupted, or read back too late, starts again, so often in all */
  uint8_t reserved[3];
  /* multi-turn: so fast the shaft may turn, for turns that are read back late; 0: 6000, below: 1 */
  int32_t max_speed_rpm;
} tm485_reset_config;
/* 50 ms, 6000 rpm, five runs. Any; constant time. */
void tm485_reset_config_default(tm485_reset_config* config);

/* Makes a run; `profile` must outlive it, `config` is copied, NULL: the default. TM485_ERR_BAD_ARGUMENT: NULL, or storage
   that is not aligned. */
TM485_NODISCARD tm485_errc tm485_reset_init(tm485_reset* reset, const tm485_profile* profile,
                                            const tm485_reset_config* config);
/* Begins. TM485_ERR_BUSY while one is active; TM485_ERR_BAD_ARGUMENT: no such kind. No EEPROM task may be open. */
TM485_NODISCARD tm485_errc tm485_reset_start(tm485_reset* reset, tm485_reset_kind kind);
/* Moves the run on. After each poll of the bus; answers when to poll the bus and call again at the latest. The cycle
   leaves the line alone meanwhile; behind a zero or multi-turn run start-up is gone through again. */
tm485_time tm485_reset_drive(tm485_reset* reset, tm485_bus* bus, tm485_time now);
bool tm485_reset_active(const tm485_reset* reset);
/* How the last run ended; false while one is active, or before the first. */
bool tm485_reset_get_outcome(const tm485_reset* reset, tm485_reset_outcome* outcome);

#ifdef __cplusplus
}
#endif
