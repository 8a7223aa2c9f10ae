/* The codec: requests to bytes, bytes to replies that hold a profile. Specification: sections 2, 3, 5 and 7.

   A bus does all of this by itself; the codec alone is for tools and for one's own background requests. Every function:
   any thread or interrupt, constant time (the CRC: one step a byte). Pointers must not be NULL. */
#pragma once

#include "tm485/c/base.h"
#include "tm485/c/profile.h"

#ifdef __cplusplus
extern "C" {
#endif

#define TM485_MAX_REQUEST 4
#define TM485_MAX_REPLY 11
#define TM485_PAGE_REGISTER 127 /* an EEPROM write there selects a page */

/* A request. Made by the functions below; a bus refuses one whose bytes are not well formed. */
typedef struct tm485_request {
  uint8_t bytes[TM485_MAX_REQUEST];
  uint8_t length; /* of `bytes` */
  tm485_data_id id;
  uint8_t address; /* of the EEPROM; 0 with other IDs */
  uint8_t data;    /* what is written; 0 with other IDs */
} tm485_request;

/* A reply's fields. Where has_ is 0, the field is 0 and means nothing. */
typedef struct tm485_reply {
  uint32_t abs;  /* single-turn position */
  uint32_t abm;  /* 24 bits as sent */
  int32_t turns; /* the turn count: `abm` with its sign, by the profile */
  tm485_data_id id;
  uint8_t sf;
  uint8_t almc;
  uint8_t enid;
  uint8_t eeprom_address;
  uint8_t eeprom_data;
  uint8_t eeprom_busy; /* the data are void */
  uint8_t has_sf;
  uint8_t has_abs;
  uint8_t has_abm; /* and turns */
  uint8_t has_enid;
  uint8_t has_almc;
  uint8_t has_eeprom; /* the three of them */
  uint8_t reserved[3];
} tm485_reply;

/* A request that is its CF alone. TM485_ERR_BAD_ARGUMENT: one of the two EEPROM IDs, or not defined. */
TM485_NODISCARD tm485_errc tm485_request_make(tm485_request* request, tm485_data_id id);
/* IDD and ID6, address 0..127. TM485_ERR_BAD_ARGUMENT: another address. */
TM485_NODISCARD tm485_errc tm485_request_eeprom_read(tm485_request* request, unsigned address);
TM485_NODISCARD tm485_errc tm485_request_eeprom_write(tm485_request* request, unsigned address, uint8_t data);
/* A request off a line. TM485_ERR_LENGTH_ERROR, a CF error, TM485_ERR_CRC_ERROR, TM485_ERR_BAD_ARGUMENT (ADF bit 7). */
TM485_NODISCARD tm485_errc tm485_request_parse(tm485_request* request, const uint8_t* bytes, size_t count);

/* The reply to a request of `id`. TM485_ERR_LENGTH_ERROR, a CF error, TM485_ERR_CF_MISMATCH, TM485_ERR_CRC_ERROR,
   TM485_ERR_ABS_OUT_OF_RANGE, TM485_ERR_ABM_RESERVED_BITS, TM485_ERR_ENID_UNEXPECTED; TM485_ERR_BAD_ARGUMENT: `id` is
   not defined. On an error nothing was written to `reply`. */
TM485_NODISCARD tm485_errc tm485_reply_parse(tm485_reply* reply, const uint8_t* bytes, size_t count,
                                             tm485_data_id id, const tm485_profile* profile);

/* Bytes of an exchange; 0 for an ID that is not defined. */
size_t tm485_request_length(tm485_data_id id);
size_t tm485_reply_length(tm485_data_id id);

/* CF of an ID of 0..15, and back: TM485_ERR_CF_SYNC_ERROR, _CF_PARITY_ERROR, _UNKNOWN_ID. */
uint8_t tm485_control_field(tm485_data_id id);
TM485_NODISCARD tm485_errc tm485_control_field_parse(tm485_data_id* id, uint8_t cf);
/* X^8+1 over the bytes; 0 over a whole frame that holds. */
uint8_t tm485_crc(const uint8_t* bytes, size_t count);

#ifdef __cplusplus
}
#endif
