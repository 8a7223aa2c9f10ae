/* What every part of the C interface uses: time, error codes, data IDs, version.

   C99 and C++. Nothing here allocates, blocks, reads a clock or needs more of a C library than memcpy and its like.
   docs/c-interface.md has the rules of names, storage and versions; docs/api-contexts.md every function's context. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "tm485/version.h"

/* Counts changes of the binary interface: sizes, members, values. tm485_abi() answers the library's. */
#define TM485_ABI 1

#if defined(__cplusplus)
#define TM485_ALIGNAS(bytes) alignas(bytes)
#elif defined(__STDC_VERSION__) && __STDC_VERSION__ >= 201112L
#define TM485_ALIGNAS(bytes) _Alignas(bytes)
#else
#define TM485_ALIGNAS(bytes) __attribute__((aligned(bytes)))
#endif

#if defined(__cplusplus) || (defined(__STDC_VERSION__) && __STDC_VERSION__ >= 202311L)
#define TM485_NODISCARD [[nodiscard]]
#elif defined(__GNUC__)
#define TM485_NODISCARD __attribute__((warn_unused_result))
#else
#define TM485_NODISCARD
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Nanoseconds since an epoch that the owner of a bus chooses (an instant), or between two instants (a span). */
typedef int64_t tm485_time;

/* "Never": a due time that does not exist. */
#define TM485_NEVER ((tm485_time)((uint64_t)1 << 62))

#define TM485_US(us) ((tm485_time)(us) * 1000)
#define TM485_MS(ms) ((tm485_time)(ms) * 1000000)

/* How something failed. "Nothing yet" is a state and has no code. */
typedef uint16_t tm485_errc;
enum {
  TM485_OK = 0,

  /* Transport: the line and the port. */
  TM485_ERR_TIMEOUT,          /* no byte of a reply before the deadline */
  TM485_ERR_INCOMPLETE_REPLY, /* a reply began and did not finish before the deadline */
  TM485_ERR_OVERLONG_REPLY,   /* more bytes than the reply has */
  TM485_ERR_LINE_NOT_QUIET,   /* bytes arrived while the encoder had nothing to say */
  TM485_ERR_ECHO_MISMATCH,    /* the echo of the own request differs from the request */
  TM485_ERR_T2_OUT_OF_WINDOW, /* the reply began outside the profile's T2 window */
  TM485_ERR_OVERRUN,          /* the receiver lost bytes */
  TM485_ERR_FRAMING_ERROR,    /* a character without a stop bit */
  TM485_ERR_SEND_FAILED,      /* the port did not take, or did not finish, a request */
  TM485_ERR_PORT_GONE,        /* the device vanished */

  /* Protocol: what the bytes say. */
  TM485_ERR_LENGTH_ERROR,            /* no frame of this family has this length */
  TM485_ERR_CF_SYNC_ERROR,           /* CF bits 0..2 are not 0,1,0 */
  TM485_ERR_CF_PARITY_ERROR,         /* CF bit 7 is not the even parity of the data ID */
  TM485_ERR_UNKNOWN_ID,              /* a well-formed CF of a data ID that is not defined */
  TM485_ERR_CF_MISMATCH,             /* a good CF, but not that of the request */
  TM485_ERR_CRC_ERROR,               /* the CRC X^8+1 does not hold */
  TM485_ERR_ABS_OUT_OF_RANGE,        /* ABS has a bit at or above the single-turn width */
  TM485_ERR_ABM_RESERVED_BITS,       /* ABM has a bit that the profile fixes at 0 */
  TM485_ERR_ENID_UNEXPECTED,         /* ENID is not among those of the profile */
  TM485_ERR_EEPROM_ADDRESS_MISMATCH, /* an EEPROM reply names another address than the request */
  TM485_ERR_ENID_INCONSISTENT,       /* ID2 and ID3 report different encoder IDs */
  TM485_ERR_FRAMES_INCONSISTENT,     /* successive positions that no shaft can do */
  TM485_ERR_STATUS_INCONSISTENT,     /* SF and ALMC contradict each other */
  TM485_ERR_POSITION_IMPLAUSIBLE,    /* the shaft cannot be there: wrong bits that pass the CRC, or a step */
  TM485_ERR_POSITION_LOST,           /* too long without a frame: turns are uncertain, or it has restarted */
  TM485_ERR_ENCODER_RESTARTED, /* the shaft is elsewhere, and the turn count is back at its start value */

  /* Device: what the encoder reports. */
  TM485_ERR_ALARM_FAULT,          /* an SF or ALMC bit whose policy is "fault" is set */
  TM485_ERR_EEPROM_BUSY,          /* ADF bit 7: the EEPROM is busy, the data are void */
  TM485_ERR_EEPROM_MISMATCH,      /* a byte of the EEPROM is not what was wanted */
  TM485_ERR_SHAFT_MOVES,          /* a zero reset wants a shaft that stands still */
  TM485_ERR_RESET_WITHOUT_EFFECT, /* ten good replies, and nothing has changed */
  TM485_ERR_EEPROM_PAGE_REFUSED,  /* the page register does not take the page */

  /* Usage: what the caller asked for. */
  TM485_ERR_BAD_ARGUMENT,      /* an argument outside its range */
  TM485_ERR_BAD_STATE,         /* not possible in the present state */
  TM485_ERR_NO_GAP,            /* the cyclic pattern leaves no room for this exchange */
  TM485_ERR_BUSY,              /* another background exchange is pending */
  TM485_ERR_PERIOD_BELOW_T1,   /* a period below the minimum T1 of the ID */
  TM485_ERR_PERIOD_BELOW_PORT, /* a period below what the port holds */
  TM485_ERR_SERVO_MISMATCH,    /* pattern and servo period are no whole multiples of one another */
  TM485_ERR_LEAD_TOO_SHORT,    /* the sample would not be there when the servo tick comes */
  TM485_ERR_ABANDONED,         /* given up before its reply: it may have taken effect */
  TM485_ERR_BAD_PROFILE,       /* a profile that contradicts itself */

  TM485_ERRC_COUNT
};

/* The data IDs, as in CF bits 3..6. */
typedef uint8_t tm485_data_id;
enum {
  TM485_ID_SINGLE_TURN = 0x0,       /* ID0: ABS */
  TM485_ID_MULTI_TURN = 0x1,        /* ID1: ABM */
  TM485_ID_ENCODER_ID = 0x2,        /* ID2: ENID */
  TM485_ID_EVERYTHING = 0x3,        /* ID3: ABS, ENID, ABM, ALMC */
  TM485_ID_EEPROM_WRITE = 0x6,      /* ID6 */
  TM485_ID_RESET_ERRORS = 0x7,      /* ID7, ten in a row */
  TM485_ID_RESET_SINGLE_TURN = 0x8, /* ID8, ten in a row: the present position becomes zero */
  TM485_ID_RESET_MULTI_TURN = 0xC,  /* IDC, ten in a row: errors and the turn count */
  TM485_ID_EEPROM_READ = 0xD        /* IDD */
};
#define TM485_DATA_ID_COUNT 9

/* SF and ALMC as a set of bits: SF is the low byte, ALMC the high one. */
typedef uint16_t tm485_status;

/* A code's stable name ("crc_error"), what happened, what to do: in static storage, ended by NUL. Never NULL; an
   unknown code has the texts of TM485_ERR_BAD_ARGUMENT. Any thread or interrupt; constant time. */
const char* tm485_errc_name(tm485_errc code);
const char* tm485_errc_cause(tm485_errc code);
const char* tm485_errc_remedy(tm485_errc code);

/* The same of a status bit, 0..7 of SF, 8..15 of ALMC: "multi_turn_error", "ALMC.5", cause, remedy. Of the number only
   the lowest four bits count. Any thread or interrupt; constant time. */
const char* tm485_status_name(unsigned bit);
const char* tm485_status_field(unsigned bit);
const char* tm485_status_cause(unsigned bit);
const char* tm485_status_remedy(unsigned bit);

/* The library's version, in numbers and as text in static storage; any pointer may be NULL. TM485_VERSION_* are those
   of the headers. Any thread or interrupt; constant time. */
const char* tm485_version(int* major_number, int* minor_number, int* patch_number);

/* The library's TM485_ABI. A program that loads a library which it was not built with asks once, before anything
   else. Any thread or interrupt; constant time. */
unsigned tm485_abi(void);

#ifdef __cplusplus
}
#endif
