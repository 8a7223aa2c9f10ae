#include "console.h"

#include "board.h"
#include "clock.h"
#include "node.h"
#include "text.h"
#include "uart.h"

static text_line line;
static bool quit;
static bool refused;

/* Waits for room in the transmitter, for ten seconds at most, and then goes on without the character: a console must not
   hold up what else main does for ever. */
static void put(void* context, char character) {
  const int64_t until = clock_now() + 10000000000;
  (void)context;
  while (!uart_write(BOARD_CONSOLE_UART, (uint8_t)character) && clock_now() < until) {
  }
}
static const text_out out = {put, NULL};

static void text(const char* words) { put_text(&out, words); }
static void number(int64_t value) { put_number(&out, value); }

/* The command was refused, and why. */
static void error(const char* why) {
  refused = true;
  text("error: ");
  text(why);
}

static void explain(tm485_errc code) {
  text(tm485_errc_name(code));
  text(": ");
  text(tm485_errc_cause(code));
  text("; ");
  text(tm485_errc_remedy(code));
  text("\n");
}

static void named(const char* name, int64_t value) {
  text(name);
  text(" ");
  number(value);
  text("\n");
}

static bool not_running(void) {
  if (node_running()) return false;
  error("not started; 'start' begins\n");
  return true;
}

static void start(const char* arguments) {
  tm485_time wanted[2] = {NODE_PERIOD, NODE_ALLOWANCE};
  tm485_refusal refusal;
  tm485_errc code;
  for (unsigned i = 0; i < 2; ++i) {
    const char* word;
    uint32_t value;
    const size_t count = next_word(&arguments, &word);
    if (count == 0) break;
    if (!word_to_number(word, count, &value)) {
      error("'");
      put_text_of(&out, word, count);
      text("' is no whole number of nanoseconds\n");
      return;
    }
    wanted[i] = value;
  }
  code = node_start(wanted[0], wanted[1], &refusal);
  if (code != TM485_OK) {
    error("refused, ");
    explain(code);
    if (refusal.nearest != 0) {
      text("nearest possible: ");
      number(refusal.nearest);
      text(" ns\n");
    }
    return;
  }
  text("started: period ");
  number(wanted[0]);
  text(" ns, allowance ");
  number(wanted[1]);
  text(" ns\n");
}

static void position(const char* arguments) {
  static const char* const kValidity[] = {"invalid", "extrapolated", "fresh"};
  static node_shown shown;
  (void)arguments;
  if (not_running()) return;
  node_get_shown(&shown);
  text("position ");
  number(shown.shaft.position);
  text(" counts, velocity ");
  number((int64_t)shown.shaft.velocity);
  text(" counts/s, turn ");
  number(shown.sample.turns);
  text(", ");
  text(kValidity[shown.validity]);
  text(", age ");
  number(tm485_sample_age(&shown.sample, shown.shaft.time) / 1000);
  text(" us, at ");
  number(shown.shaft.time / 1000);
  text(" us\n");
  if (shown.view.latched) text("the encoder was lost; 'resume' when it may go on\n");
  if (shown.view.state != TM485_STATE_RUNNING) {
    text("start-up: ");
    explain(shown.view.startup_cause);
  }
}

static tm485_statistics statistics;

static bool read_statistics(void) {
  if (not_running()) return false;
  if (node_statistics(&statistics)) return true;
  error("none yet, ask again\n");
  return false;
}

static void show_statistics(const char* arguments) {
  static node_shown shown;
  (void)arguments;
  if (!read_statistics()) return;
  node_get_shown(&shown);
  named("cycles", statistics.cycles);
  named("good", statistics.good);
  named("failed", statistics.failed);
  named("slips", statistics.slips);
  named("background", statistics.background);
  named("displaced", statistics.displaced);
  named("startups", statistics.startups);
  named("startup_failures", statistics.startup_failures);
  named("lost", statistics.lost);
  named("invalidated", statistics.invalidated);
  named("stray_bytes", statistics.stray_bytes);
  named("warnings", statistics.warnings);
  named("faults", statistics.faults);
  named("t1_min_ns", statistics.t1.minimum);
  named("t1_mean_ns", statistics.t1.mean);
  named("t1_max_ns", statistics.t1.maximum);
  named("control_ticks", shown.ticks);
  named("control_fresh", shown.fresh);
}

static void errors(const char* arguments) {
  bool any = false;
  (void)arguments;
  if (!read_statistics()) return;
  for (unsigned code = 0; code < TM485_ERRC_COUNT; ++code) {
    if (statistics.errors[code] == 0) continue;
    any = true;
    number(statistics.errors[code]);
    text(" ");
    explain((tm485_errc)code);
  }
  if (!any) text("no errors\n");
}

static void eeprom(const char* arguments) {
  (void)arguments;
  if (!not_running() && !node_read_eeprom()) error("it is being read\n");
}

static void resume(const char* arguments) {
  (void)arguments;
  if (!not_running()) node_resume();
}

static void leave(const char* arguments) {
  (void)arguments;
  quit = true;
}

static void help(const char* arguments);

static const struct {
  const char* name;
  const char* help;
  void (*run)(const char* arguments); /* these are what is behind its name */
} kCommands[] = {
    {"help", "this list", help},
    {"start", "[PERIOD_NS [ALLOWANCE_NS]]: begin to read the encoder", start},
    {"position", "position, velocity, validity", position},
    {"statistics", "what the bus has counted", show_statistics},
    {"errors", "each error that has occurred, with cause and remedy", errors},
    {"eeprom", "read the encoder's EEPROM, page by page", eeprom},
    {"resume", "leave the latched invalid state", resume},
    {"quit", "end the program", leave},
};
#define COMMANDS (sizeof kCommands / sizeof kCommands[0])

static void help(const char* arguments) {
  (void)arguments;
  for (size_t i = 0; i < COMMANDS; ++i) {
    text(kCommands[i].name);
    text("  ");
    text(kCommands[i].help);
    text("\n");
  }
}

static void execute(const char* at) {
  const char* word;
  const size_t count = next_word(&at, &word);
  if (count == 0) return;
  for (size_t i = 0; i < COMMANDS; ++i) {
    if (!word_is(word, count, kCommands[i].name)) continue;
    refused = false;
    kCommands[i].run(at);
    if (!refused) text("ok\n");
    return;
  }
  text("error: no command '");
  put_text_of(&out, word, count);
  text("'; help lists them\n");
}

static void show_eeprom(const tm485_eeprom_outcome* outcome, const uint8_t* bytes) {
  enum { PAGE = 127, ROW = 16 };
  if (outcome->code != TM485_OK) {
    text("error: page ");
    number(outcome->page);
    text(" address ");
    number(outcome->address);
    text(": ");
    explain(outcome->code);
    return;
  }
  for (unsigned at = 0; at < NODE_EEPROM_BYTES; at += PAGE) {
    named("page", at / PAGE);
    for (unsigned row = 0; row < PAGE; row += ROW) {
      for (unsigned i = row; i < row + ROW && i < PAGE; ++i) put_hex(&out, bytes[at + i]);
      text("\n");
    }
  }
  text("eeprom: ");
  number(NODE_EEPROM_BYTES);
  text(" bytes\n");
}

bool console_start(void) {
  if (!uart_start(BOARD_CONSOLE_UART, BOARD_CONSOLE_UART_HZ, BOARD_CONSOLE_BIT_RATE)) return false;
  text("tm485 ");
  text(tm485_version(NULL, NULL, NULL));
  text(" servo_node_c on " BOARD_NAME "\nhelp lists the commands\n");
  return true;
}

bool console_step(void) {
  uint8_t byte;
  tm485_errc fault;
  tm485_eeprom_outcome outcome;
  const uint8_t* bytes;
  while (!quit && uart_read(BOARD_CONSOLE_UART, &byte, &fault)) {
    if (!line_take(&line, (char)byte)) continue;
    if (line.too_long) {
      text("error: a line has at most ");
      number(LINE_LONGEST);
      text(" characters\n");
    } else {
      execute(line.text);
    }
    line_clear(&line);
  }
  if (node_take_eeprom(&outcome, &bytes)) show_eeprom(&outcome, bytes);
  return quit;
}
