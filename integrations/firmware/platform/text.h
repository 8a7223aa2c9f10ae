/* Text without printf: a line that is put together in a buffer of the caller's, and a line that comes in character by
   character. No heap, no floating point. Any context; each object has one owner. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Where text goes, character by character. */
typedef struct text_out {
  void (*put)(void* context, char character);
  void* context;
} text_out;

void put_text(const text_out* out, const char* text);
void put_text_of(const text_out* out, const char* text, size_t count);
void put_number(const text_out* out, int64_t number);
/* Two digits. */
void put_hex(const text_out* out, uint8_t byte);

/* A command line: words, of which the first says what to do. */
#define LINE_LONGEST 47
typedef struct text_line {
  char text[LINE_LONGEST + 1];
  uint8_t count;
  bool too_long;
} text_line;

/* Takes a character. True when a line has ended (CR or LF): look at `too_long`, use `text`, and call line_clear(). Empty
   lines are left out. */
bool line_take(text_line* line, char character);
void line_clear(text_line* line);

/* The next word of a line and how long it is, from `*at` on, which moves behind it; 0: there is none. */
size_t next_word(const char** at, const char** word);
bool word_is(const char* word, size_t count, const char* text);
/* A whole number from 0 to 4 294 967 295 as a word; false: it is none. */
bool word_to_number(const char* word, size_t count, uint32_t* number);

#ifdef __cplusplus
}
#endif
