/* The console: lines of text on the second UART; an answer ends with a line "ok" or "error: ...". All of it in main. */
#pragma once

#include <stdbool.h>

/* Sets the UART up and greets. False: the UART does not answer. */
bool console_start(void);
/* Takes what has come in, and answers. True once `quit` was asked for. */
bool console_step(void);
