#include "semihosting.h"

#include <stdint.h>

enum { SYS_WRITE0 = 0x04, SYS_GET_CMDLINE = 0x15, SYS_EXIT_EXTENDED = 0x20 };

#define APPLICATION_EXIT 0x20026u

static uintptr_t call(uintptr_t operation, const void* argument) {
  register uintptr_t r0 __asm("r0") = operation;
  register const void* r1 __asm("r1") = argument;
  __asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
  return r0;
}

void host_exit(int code) {
  const uintptr_t block[2] = {APPLICATION_EXIT, (uintptr_t)code};
  (void)call(SYS_EXIT_EXTENDED, block);
  for (;;) {
  }
}

void host_print(const char* text) { (void)call(SYS_WRITE0, text); }

void host_command_line(char* text, size_t size) {
  uintptr_t block[2] = {(uintptr_t)text, size};
  if (call(SYS_GET_CMDLINE, block) != 0) block[1] = 0;
  text[block[1] < size ? block[1] : 0] = '\0';
}
