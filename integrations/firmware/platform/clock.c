/* The counter is extended to 64 bits at each reading: what it has counted since the last one, times the nanoseconds of
   one count, is added. What the multiplication rounds off is kept, so nothing is lost however often it is read. */
#include "clock.h"

#include "board.h"
#include "cortex_m.h"

#define DEBUG_CONTROL REGISTER32(0xE000EDFCu) /* DEMCR; bit 24 lets DWT run */
#define DWT_CONTROL REGISTER32(0xE0001000u)
#define DWT_CYCLES REGISTER32(0xE0001004u)

static bool cycles_count;
static uint32_t last;
static uint32_t ns_per_count; /* 2^24 is 1 ns */
static uint32_t rest;         /* what the last reading has rounded off, in the same unit */
static int64_t now_ns;

static uint32_t counter(void) { return cycles_count ? DWT_CYCLES : board_counter(); }

#if defined(__ARM_ARCH) && __ARM_ARCH >= 7
static bool start_cycle_counter(void) {
  uint32_t before;
  DEBUG_CONTROL |= 1u << 24;
  DWT_CONTROL |= 1u;
  before = DWT_CYCLES;
  __asm volatile("nop\n nop\n nop\n nop");
  return DWT_CYCLES != before;
}
#else
static bool start_cycle_counter(void) { return false; }
#endif

bool clock_start(void) {
  uint32_t hz;
  cycles_count = start_cycle_counter();
  hz = cycles_count ? BOARD_CORE_HZ : BOARD_COUNTER_HZ;
  ns_per_count = (uint32_t)((((uint64_t)1000000000u << 24) + hz / 2) / hz);
  last = counter();
  rest = 0;
  now_ns = 0;
  return cycles_count;
}

int64_t clock_now(void) {
  const uint32_t state = interrupts_off();
  const uint32_t at = counter();
  const uint64_t passed = (uint64_t)(at - last) * ns_per_count + rest;
  int64_t now;
  last = at;
  rest = (uint32_t)passed & 0x00FFFFFFu;
  now_ns += (int64_t)(passed >> 24);
  now = now_ns;
  interrupts_back(state);
  return now;
}
