/* What a debugger or QEMU does for a program: an exit code, text, its command line. Without either the core stops at the
   first call, so a product leaves all of it out (docs/firmware.md). Source: ARM "Semihosting for AArch32 and AArch64". */
#pragma once

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Ends QEMU with this exit code. Does not come back. */
void host_exit(int code) __attribute__((noreturn));
/* Prints a text that ends with NUL. */
void host_print(const char* text);
/* The command line, ended by NUL; "" if there is none or it is longer than `size`. */
void host_command_line(char* text, size_t size);

#ifdef __cplusplus
}
#endif
