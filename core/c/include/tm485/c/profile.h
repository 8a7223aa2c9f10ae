/* Profiles: everything about an encoder that the documents leave open. Specification: sections 4, 7 and 9.

   A profile is compiled once, at set-up, from a preset or from settings, and read by everything else; it must outlive
   whatever it is given to, and stay where it is. */
#pragma once

#include "tm485/c/base.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Plain data: take a preset's, change, compile. Flags are 0 or 1. */
typedef struct tm485_profile_settings {
  tm485_time
      t1[TM485_DATA_ID_COUNT]; /* by ID: 0 1 2 3 6 7 8 C D; request start to next request start, at least */
  tm485_time t2_min;           /* window of the reply's start bit */
  tm485_time t2_max;
  tm485_time latch_offset;      /* position latched this long after the request's last stop bit */
  tm485_time latch_uncertainty; /* +- of the latch instant */
  tm485_time power_up_time;     /* answers at the latest this long after power-up */
  tm485_time boot_time_min;     /* and not earlier than this */
  tm485_time reset_spacing;
  tm485_time reset_zero_settle; /* ID8 takes effect */
  tm485_time eeprom_write_time;
  tm485_time eeprom_page_time;
  const char* name;             /* ended by NUL; must outlive the profiles compiled from it; NULL: "custom" */
  uint32_t bit_rate;            /* bit/s, 9600..10000000 */
  uint32_t abm_reserved;        /* ABM bits that are 0 */
  int32_t multi_turn_start;     /* turn count after IDC, and after power-up without battery */
  tm485_status reserved_status; /* counted; they drop nothing */
  tm485_status alarm_warn;      /* bits in neither set are ignored */
  tm485_status alarm_fault;
  uint8_t single_turn_bits; /* 8..24 */
  uint8_t multi_turn_bits;  /* 0 (single-turn only) or 8..24 */
  uint8_t enids[4];         /* the encoder IDs that are accepted */
  uint8_t enid_count;       /* 0: any */
  uint8_t battery;          /* turns survive a power-off */
  uint8_t echo;             /* the port receives its own requests */
  uint8_t reset_count;
  uint8_t eeprom_pages;
  uint8_t eeprom_page_bytes;
  uint8_t eeprom_holds_bus; /* nothing else is sent while a write or page change takes place */
  uint8_t reserved;
} tm485_profile_settings;

/* Why settings were refused. The texts are in static storage, ended by NUL; "" if there is none. */
typedef struct tm485_profile_error {
  const char* field;
  const char* why;
} tm485_profile_error;

/* A compiled profile, in storage of the caller's. */
#if UINTPTR_MAX > 0xFFFFFFFFu
#define TM485_PROFILE_SIZE 560
#else
#define TM485_PROFILE_SIZE 552
#endif
typedef union tm485_profile {
  uint64_t align;
  unsigned char storage[TM485_PROFILE_SIZE];
} tm485_profile;
/* What the library needs; not more than TM485_PROFILE_SIZE. Any. */
size_t tm485_profile_size(void);

/* The presets: their number, and the name of each, ended by NUL; NULL beyond the last. Any; constant time. */
size_t tm485_preset_count(void);
const char* tm485_preset_name(size_t index);

/* The settings of a preset. Set-up. TM485_ERR_BAD_ARGUMENT: no preset of that name, or NULL. */
TM485_NODISCARD tm485_errc tm485_profile_settings_get(tm485_profile_settings* settings, const char* preset);

/* Checks and compiles; some hundred operations, so not in the cycle. Set-up. TM485_ERR_BAD_PROFILE: settings that
   contradict themselves, `why` (may be NULL) says where; TM485_ERR_BAD_ARGUMENT: NULL, or storage that is not aligned.
   On an error nothing was written to `profile`. */
TM485_NODISCARD tm485_errc tm485_profile_compile(tm485_profile* profile,
                                                 const tm485_profile_settings* settings,
                                                 tm485_profile_error* why);

/* A preset, compiled. Set-up. TM485_ERR_BAD_ARGUMENT: no preset of that name, NULL, or storage not aligned. */
TM485_NODISCARD tm485_errc tm485_profile_init(tm485_profile* profile, const char* preset);

/* What it was compiled from. Any; constant time. */
void tm485_profile_settings_of(tm485_profile_settings* settings, const tm485_profile* profile);

/* T1 of an ID; 0 for an ID that is not defined. Any; constant time. */
tm485_time tm485_profile_t1(const tm485_profile* profile, tm485_data_id id);
/* Longest time from a request's start to the end of its reply; 0 for an ID that is not defined. Any; constant time. */
tm485_time tm485_profile_exchange_max(const tm485_profile* profile, tm485_data_id id);

/* How encoder counts become the position of this axis. All integers. Flags are 0 or 1. */
typedef uint8_t tm485_units;
enum { TM485_UNITS_COUNTS, TM485_UNITS_REV, TM485_UNITS_DEG, TM485_UNITS_RAD };

/* An encoder was lost or restarted: the position is invalid until start-up is through, and then. */
typedef uint8_t tm485_continuity;
enum {
  TM485_CONTINUITY_UNTIL_RESUMED, /* an axis stays invalid until somebody resumes */
  TM485_CONTINUITY_UNTIL_HOMED,   /* likewise, and nobody can resume before it was referenced again */
  TM485_CONTINUITY_RE_REFERENCE /* the position nearest to the last; only for a shaft that stands meanwhile */
};

typedef struct tm485_axis_config {
  int64_t zero_offset;            /* encoder counts that become position 0, before direction */
  int32_t reference_turn;         /* turn count that becomes turn 0, if has_reference_turn */
  int32_t gear_numerator;         /* load revolutions = motor revolutions * numerator / denominator */
  int32_t gear_denominator;       /* not 0 */
  uint32_t electrical_offset;     /* added to the electrical angle; 2^32 is one electrical turn */
  int32_t max_speed_rpm;          /* faster than the shaft can turn */
  int32_t max_acceleration_rpm_s; /* more than the shaft is ever accelerated */
  uint16_t pole_pairs;            /* electrical turns per mechanical turn */
  uint8_t reversed;               /* 0: counter-clockwise seen from the output shaft is positive */
  uint8_t has_reference_turn;     /* 0: the profile's multi_turn_start becomes turn 0 */
  tm485_units units;              /* of tm485_to_units() */
  tm485_continuity after_restart; /* what becomes of an axis whose encoder was lost or restarted */
  uint8_t reserved[2];
} tm485_axis_config;

/* Counts as they come, gear 1, one pole pair, 6000 rpm, 1 000 000 rpm/s. Any; constant time. */
void tm485_axis_config_default(tm485_axis_config* config);

/* A position in motor counts as load-side units. Any; floating point of double precision. */
double tm485_to_units(int64_t position, const tm485_axis_config* config, unsigned single_turn_bits);

#ifdef __cplusplus
}
#endif
