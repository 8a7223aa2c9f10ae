/* EEPROM tasks: read, write and verify ranges of the encoder's EEPROM, one background exchange at a time, beside the
   cycle. Specification: section 5; docs/eeprom.md.

   Context: the bus's. Every function: constant time. Handles must not be NULL and must have been initialised; only
   tm485_eeprom_init() looks. Addresses are linear: page times bytes of a page, plus the address within the page. */
#pragma once

#include "tm485/c/base.h"
#include "tm485/c/bus.h"
#include "tm485/c/profile.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A manager, in storage of the caller's. It must stay where it is. */
#if UINTPTR_MAX > 0xFFFFFFFFu
#define TM485_EEPROM_SIZE 208
#else
#define TM485_EEPROM_SIZE 168
#endif
typedef union tm485_eeprom {
  uint64_t align;
  unsigned char storage[TM485_EEPROM_SIZE];
} tm485_eeprom;
/* What the library needs; not more than TM485_EEPROM_SIZE. Any. */
size_t tm485_eeprom_size(void);

/* How a task ended. */
typedef struct tm485_eeprom_outcome {
  tm485_errc code;
  uint8_t page; /* and which byte it is about */
  uint8_t address;
  uint8_t wanted; /* with TM485_ERR_EEPROM_MISMATCH: what should be there */
  uint8_t found;
} tm485_eeprom_outcome;

typedef struct tm485_eeprom_progress {
  /* Bytes that are dealt with. Behind a write without echo it goes back to 0: they are looked at once more. */
  uint32_t done;
  uint32_t total;
  uint32_t writes;       /* of bytes: each costs one of the cell's 100 000 */
  uint32_t page_selects; /* writes of the page register */
  uint32_t retries;      /* exchanges that failed and were repeated */
  uint32_t repaired;     /* bytes that noise had changed, put back */
  uint32_t mismatches;   /* verify: bytes that differ */
  uint32_t
      unconfirmed_pages; /* one bit a page: noise may have changed a byte of it, and nobody can say which */
} tm485_eeprom_progress;

/* What may hold neither the old nor the new value if nothing more is done, as after a cable was pulled. */
typedef struct tm485_eeprom_doubt {
  uint32_t pages; /* one bit a page: any byte of it */
  uint8_t page;   /* the byte that was being written or looked at */
  uint8_t address;
  uint8_t reserved[2];
} tm485_eeprom_doubt;

/* Makes a manager. `profile` must outlive it. What is known of the contents, by linear address: `value` and `known` have
   as many elements as the EEPROM has bytes (`count`), are read and updated, and must outlive it as well; with them a byte
   that noise has changed can be put back. NULL, NULL and 0: nothing is known. TM485_ERR_BAD_ARGUMENT: NULL, storage
   that is not aligned, another `count`. */
TM485_NODISCARD tm485_errc tm485_eeprom_init(tm485_eeprom* eeprom, const tm485_profile* profile,
                                             uint8_t* value, bool* known, size_t count);
/* Bytes in all. */
uint32_t tm485_eeprom_bytes(const tm485_eeprom* eeprom);
/* The linear address of a byte. TM485_ERR_BAD_ARGUMENT: a page that the profile has not, or the page register. */
TM485_NODISCARD tm485_errc tm485_eeprom_linear(const tm485_eeprom* eeprom, unsigned page, unsigned address,
                                               uint32_t* linear);

/* Begin a task on `count` bytes from `first` on; the bytes must last until it is over. Write: those that differ, each
   read back. Verify: the outcome is TM485_ERR_EEPROM_MISMATCH with the first byte that differs. TM485_ERR_BAD_ARGUMENT:
   not within the EEPROM; TM485_ERR_BUSY: a task is active. */
TM485_NODISCARD tm485_errc tm485_eeprom_start_read(tm485_eeprom* eeprom, uint32_t first, uint8_t* to,
                                                   size_t count);
TM485_NODISCARD tm485_errc tm485_eeprom_start_write(tm485_eeprom* eeprom, uint32_t first, const uint8_t* from,
                                                    size_t count);
TM485_NODISCARD tm485_errc tm485_eeprom_start_verify(tm485_eeprom* eeprom, uint32_t first,
                                                     const uint8_t* with, size_t count);
/* Ends the task behind the byte that is being written, with TM485_ERR_ABANDONED. What was done stays done. */
void tm485_eeprom_cancel(tm485_eeprom* eeprom);

/* Moves the task on. After each poll of the bus; answers when to poll the bus and call again at the latest. */
tm485_time tm485_eeprom_drive(tm485_eeprom* eeprom, tm485_bus* bus, tm485_time now);

bool tm485_eeprom_active(const tm485_eeprom* eeprom);
/* How the last task ended; false while one is active, or before the first. */
bool tm485_eeprom_get_outcome(const tm485_eeprom* eeprom, tm485_eeprom_outcome* outcome);
void tm485_eeprom_get_progress(const tm485_eeprom* eeprom, tm485_eeprom_progress* progress);
/* How long the rest takes if nothing fails; of a write, if every byte that is left must be written. */
tm485_time tm485_eeprom_time_left(const tm485_eeprom* eeprom);
/* What a write has left in doubt so far, of the task that is active or of the last one that did not end well; false:
   nothing. */
bool tm485_eeprom_in_doubt(const tm485_eeprom* eeprom, tm485_eeprom_doubt* doubt);

#ifdef __cplusplus
}
#endif
