#include "text.h"

void put_text(const text_out* out, const char* text) {
  while (*text != '\0') out->put(out->context, *text++);
}

void put_text_of(const text_out* out, const char* text, size_t count) {
  for (size_t i = 0; i < count; ++i) out->put(out->context, text[i]);
}

void put_number(const text_out* out, int64_t number) {
  char digits[20]; /* 2^64 has twenty */
  size_t count = 0;
  uint64_t rest = number < 0 ? 0u - (uint64_t)number : (uint64_t)number;
  do {
    digits[count++] = (char)('0' + rest % 10u);
    rest /= 10u;
  } while (rest != 0);
  if (number < 0) out->put(out->context, '-');
  while (count != 0) out->put(out->context, digits[--count]);
}

void put_hex(const text_out* out, uint8_t byte) {
  static const char kDigits[] = "0123456789ABCDEF";
  out->put(out->context, kDigits[byte >> 4]);
  out->put(out->context, kDigits[byte & 0xFu]);
}

bool line_take(text_line* line, char character) {
  if (character == '\r' || character == '\n') {
    line->text[line->count] = '\0';
    return line->count != 0;
  }
  if (line->count == LINE_LONGEST) {
    line->too_long = true;
  } else {
    /* What cannot be shown becomes what no command has. */
    line->text[line->count++] = character >= ' ' && character <= '~' ? character : '?';
  }
  return false;
}

void line_clear(text_line* line) {
  line->count = 0;
  line->too_long = false;
}

size_t next_word(const char** at, const char** word) {
  size_t count = 0;
  while (**at == ' ') ++*at;
  *word = *at;
  while (**at != ' ' && **at != '\0') {
    ++*at;
    ++count;
  }
  return count;
}

bool word_is(const char* word, size_t count, const char* text) {
  size_t i = 0;
  while (i < count && text[i] == word[i]) ++i;
  return i == count && text[i] == '\0';
}

bool word_to_number(const char* word, size_t count, uint32_t* number) {
  uint64_t value = 0;
  for (size_t i = 0; i < count; ++i) {
    if (word[i] < '0' || word[i] > '9') return false;
    value = value * 10u + (uint64_t)(word[i] - '0');
    if (value > UINT32_MAX) return false;
  }
  *number = (uint32_t)value;
  return count != 0;
}
