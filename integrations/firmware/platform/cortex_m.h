/* The registers of every Cortex-M that the examples use: interrupts, SysTick, the cycle counter. Sources: ARM DDI 0403
   (ARMv7-M), B3; ARM DDI 0419 (ARMv6-M), B3. */
#pragma once

#include <stdint.h>

#define REGISTER32(address) (*(volatile uint32_t*)(uintptr_t)(address))

/* Priorities: the four highest bits of a byte count on every core here; a lower number preempts a higher one. */
#define PRIORITY_CONTROL 0x40u
#define PRIORITY_BUS 0x80u

#ifdef __cplusplus
extern "C" {
#endif

/* No interrupt between the two calls, whatever state the caller was in. */
static inline uint32_t interrupts_off(void) {
  uint32_t state;
  __asm volatile("mrs %0, primask\n cpsid i" : "=r"(state)::"memory");
  return state;
}
static inline void interrupts_back(uint32_t state) {
  __asm volatile("msr primask, %0" ::"r"(state) : "memory");
}

/* Sleeps until an interrupt. */
static inline void wait_for_interrupt(void) { __asm volatile("wfi" ::: "memory"); }

/* An external interrupt, on at this priority. */
static inline void interrupt_on(unsigned number, uint32_t priority) {
  volatile uint8_t* const priorities = (volatile uint8_t*)(uintptr_t)0xE000E400u;
  priorities[number] = (uint8_t)priority;
  REGISTER32(0xE000E100u + 4u * (number / 32u)) = 1u << (number % 32u);
}

#ifdef __cplusplus
}
#endif
