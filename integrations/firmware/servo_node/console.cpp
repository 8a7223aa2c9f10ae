#include "console.hpp"

#include <array>
#include <span>

#include "board.h"
#include "clock.h"
#include "tm485/errc.hpp"
#include "tm485/mcu/baud.hpp"
#include "tm485/version.hpp"

namespace servo_node {
namespace {

using tm485::Errc;
using tm485::Time;

constexpr auto kDivisor =
    *tm485::mcu::solve_baud(BoardUart::kFamily, BOARD_CONSOLE_UART_HZ, BOARD_CONSOLE_BIT_RATE);

std::string_view name_of(tm485::SampleValidity validity) noexcept {
  switch (validity) {
    case tm485::SampleValidity::fresh:
      return "fresh";
    case tm485::SampleValidity::extrapolated:
      return "extrapolated";
    case tm485::SampleValidity::invalid:
      break;
  }
  return "invalid";
}

/// A counter and its name.
struct Counter {
  std::string_view name;
  std::uint32_t tm485::Statistics::* value;
};
constexpr std::array kCounters{
    Counter{"cycles", &tm485::Statistics::cycles},
    Counter{"good", &tm485::Statistics::good},
    Counter{"failed", &tm485::Statistics::failed},
    Counter{"slips", &tm485::Statistics::slips},
    Counter{"background", &tm485::Statistics::background},
    Counter{"displaced", &tm485::Statistics::displaced},
    Counter{"startups", &tm485::Statistics::startups},
    Counter{"startup_failures", &tm485::Statistics::startup_failures},
    Counter{"lost", &tm485::Statistics::lost},
    Counter{"invalidated", &tm485::Statistics::invalidated},
    Counter{"stray_bytes", &tm485::Statistics::stray_bytes},
    Counter{"warnings", &tm485::Statistics::warnings},
    Counter{"faults", &tm485::Statistics::faults},
};

}  // namespace

/// A command; its arguments are what is behind its name.
struct Console::Command {
  const char* name;
  const char* help;
  void (*run)(Console& console, const char* arguments);
};

Console::Console(Node& node) noexcept
    : node_(node),
      uart_(tm485::mcu::VolatileRegisters(std::uintptr_t{BOARD_CONSOLE_UART})),
      out_{[](void* context, char character) { static_cast<Console*>(context)->put(character); }, this} {}

bool Console::start() noexcept {
  if (!uart_.configure(kDivisor)) return false;
  text("tm485 ").text(tm485::version().text).text(" servo_node on " BOARD_NAME "\nhelp lists the commands\n");
  return true;
}

std::optional<int> Console::step() noexcept {
  for (auto character = uart_.try_read(); character.present && !exit_; character = uart_.try_read()) {
    if (!line_take(&line_, static_cast<char>(character.byte))) continue;
    if (line_.too_long) {
      text("error: a line has at most ").number(LINE_LONGEST).text(" characters\n");
    } else {
      execute(line_.text);
    }
    line_clear(&line_);
  }
  if (const auto outcome = node_.take_eeprom_outcome()) show_eeprom(*outcome);
  return exit_;
}

std::span<const Console::Command> Console::commands() noexcept {
  static constexpr std::array kCommands{
      Command{"help", "this list", [](Console& c, const char*) { c.help(); }},
      Command{"start", "[PERIOD_NS [ALLOWANCE_NS]]: begin to read the encoder",
              [](Console& c, const char* arguments) { c.begin(arguments); }},
      Command{"position", "position, velocity, validity", [](Console& c, const char*) { c.position(); }},
      Command{"statistics", "what the bus has counted", [](Console& c, const char*) { c.statistics(); }},
      Command{"errors", "each error that has occurred, with cause and remedy",
              [](Console& c, const char*) { c.errors(); }},
      Command{"eeprom", "read the encoder's EEPROM, page by page",
              [](Console& c, const char*) { c.eeprom(); }},
      Command{"resume", "leave the latched invalid state", [](Console& c, const char*) { c.resume(); }},
      Command{"quit", "end the program", [](Console& c, const char*) { c.exit_ = 0; }},
  };
  return kCommands;
}

void Console::execute(const char* line) noexcept {
  const char* word = nullptr;
  const std::size_t count = next_word(&line, &word);
  if (count == 0) return;
  for (const Command& command : commands())
    if (word_is(word, count, command.name)) {
      refused_ = false;
      command.run(*this, line);
      if (!refused_) text("ok\n");
      return;
    }
  text("error: no command '").text({word, count}).text("'; help lists them\n");
}

void Console::help() noexcept {
  for (const Command& command : commands()) text(command.name).text("  ").text(command.help).text("\n");
}

void Console::begin(const char* arguments) noexcept {
  Parameters parameters;
  for (Time* const wanted : {&parameters.period, &parameters.allowance}) {
    const char* word = nullptr;
    const std::size_t count = next_word(&arguments, &word);
    std::uint32_t value = 0;
    if (count == 0) break;
    if (!word_to_number(word, count, &value)) {
      error("'").text({word, count}).text("' is no whole number of nanoseconds\n");
      return;
    }
    *wanted = Time{value};
  }
  if (const auto started = node_.start(parameters); !started) {
    error("refused, ");
    explain(started.error().code);
    if (started.error().nearest != Time{0})
      text("nearest possible: ").number(started.error().nearest.count()).text(" ns\n");
    return;
  }
  text("started: period ").number(parameters.period.count()).text(" ns, allowance ");
  number(parameters.allowance.count()).text(" ns\n");
}

void Console::position() noexcept {
  if (not_running()) return;
  const Shown& shown = node_.shown();
  text("position ").number(shown.shaft.position).text(" counts, velocity ");
  number(static_cast<std::int64_t>(shown.shaft.velocity)).text(" counts/s, turn ");
  number(shown.sample.turns()).text(", ").text(name_of(shown.validity)).text(", age ");
  number(shown.sample.age(shown.shaft.time).count() / 1000).text(" us, at ");
  number(shown.shaft.time.count() / 1000).text(" us\n");
  if (shown.latched) text("the encoder was lost; 'resume' when it may go on\n");
  if (shown.state != tm485::BusState::running) {
    text("start-up: ");
    explain(shown.startup_cause);
  }
}

void Console::statistics() noexcept {
  tm485::Statistics statistics;
  if (not_running() || !read_statistics(statistics)) return;
  for (const Counter& counter : kCounters) named(counter.name, statistics.*counter.value);
  named("t1_min_ns", statistics.t1.minimum().count());
  named("t1_mean_ns", statistics.t1.mean().count());
  named("t1_max_ns", statistics.t1.maximum().count());
  named("control_ticks", node_.shown().ticks);
  named("control_fresh", node_.shown().fresh);
}

void Console::errors() noexcept {
  tm485::Statistics statistics;
  if (not_running() || !read_statistics(statistics)) return;
  bool any = false;
  for (std::size_t i = 0; i < statistics.errors.size(); ++i) {
    if (statistics.errors[i] == 0) continue;
    any = true;
    number(statistics.errors[i]).text(" ");
    explain(static_cast<Errc>(i));
  }
  if (!any) text("no errors\n");
}

void Console::resume() noexcept {
  if (not_running()) return;
  node_.resume();
}

void Console::eeprom() noexcept {
  if (not_running()) return;
  if (!node_.read_eeprom()) error("it is being read\n");
}

void Console::show_eeprom(const tm485::EepromError& outcome) noexcept {
  if (outcome.code != Errc::ok) {
    text("error: page ").number(outcome.page).text(" address ").number(outcome.address).text(": ");
    explain(outcome.code);
    return;
  }
  constexpr std::size_t kPage = 127;
  constexpr std::size_t kRow = 16;
  const auto bytes = node_.eeprom();
  for (std::size_t at = 0; at < bytes.size(); at += kPage) {
    text("page ").number(static_cast<std::int64_t>(at / kPage)).text("\n");
    for (std::size_t row = 0; row < kPage; row += kRow) {
      for (std::size_t i = row; i < row + kRow && i < kPage; ++i) put_hex(&out_, bytes[at + i]);
      text("\n");
    }
  }
  text("eeprom: ").number(static_cast<std::int64_t>(bytes.size())).text(" bytes\n");
}

bool Console::not_running() noexcept {
  if (node_.running()) return false;
  error("not started; 'start' begins\n");
  return true;
}

bool Console::read_statistics(tm485::Statistics& to) noexcept {
  if (node_.statistics(to)) return true;
  error("none yet, ask again\n");
  return false;
}

/// Waits for room in the transmitter, for ten seconds at most, and then goes on without the character: a console must not
/// hold up what else main does for ever.
void Console::put(char character) noexcept {
  constexpr std::int64_t kPatience = 10'000'000'000;
  const std::int64_t until = clock_now() + kPatience;
  while (!uart_.try_write(static_cast<std::uint8_t>(character)) && clock_now() < until) {
  }
}

Console& Console::text(std::string_view text) noexcept {
  put_text_of(&out_, text.data(), text.size());
  return *this;
}

Console& Console::number(std::int64_t number) noexcept {
  put_number(&out_, number);
  return *this;
}

Console& Console::error(std::string_view what) noexcept {
  refused_ = true;
  return text("error: ").text(what);
}

void Console::named(std::string_view name, std::int64_t value) noexcept {
  text(name).text(" ").number(value).text("\n");
}

void Console::explain(Errc code) noexcept {
  const tm485::ErrorInfo& info = tm485::describe(code);
  text(info.name).text(": ").text(info.cause).text("; ").text(info.remedy).text("\n");
}

}  // namespace servo_node
