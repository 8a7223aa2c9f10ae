/* The node: one encoder on one line, in three contexts.

     bus      bus timer and UART, one priority: tm485_axis_*, EEPROM tasks
     control  the control loop's interrupt, which preempts the bus: tm485_loop_*
     main     the console: what is declared here */
#pragma once

#include "tm485/c/tm485.h"

#define NODE_PERIOD 62500   /* ns, request start to request start */
#define NODE_ALLOWANCE 4000 /* ns, see tm485_port_capability */
#define NODE_EEPROM_BYTES (7 * 127)

/* What the control loop has seen last. */
typedef struct node_shown {
  tm485_estimate shaft;
  tm485_sample sample;
  tm485_loop_view view;
  tm485_validity validity;
  uint32_t ticks; /* of the control loop */
  uint32_t fresh; /* of these, with a fresh sample */
} node_shown;

/* Sets the line up and begins; the interrupts go on by themselves from here. Errors: TM485_ERR_BUSY if it runs, those of
   encoder_port_start(), tm485_axis_init() and tm485_axis_start(); `refusal` says what would be possible. */
TM485_NODISCARD tm485_errc node_start(tm485_time period, tm485_time allowance, tm485_refusal* refusal);
bool node_running(void);
/* As of the control loop's last tick. */
void node_get_shown(node_shown* shown);
/* False: ask again. */
bool node_statistics(tm485_statistics* statistics);
/* Leaves the latched invalid state: the operator says so. */
void node_resume(void);
/* Reads the whole EEPROM. False: it is being read. */
bool node_read_eeprom(void);
/* How that has ended, once; false: not yet, or nobody has asked. */
bool node_take_eeprom(tm485_eeprom_outcome* outcome, const uint8_t** bytes);
