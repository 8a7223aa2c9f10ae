// minimal: the smallest loop that reads an encoder, for cores without a floating-point unit: no interrupt, no console, one
// UART, and the estimator in integers. docs/firmware.md.
//
//   minimal [PERIOD_NS [ALLOWANCE_NS [CYCLES]]]      as the command line of semihosting
//
// Prints a line every 500 cycles, and an account at the end. Exit code 0 if the last position was usable.
#include <cstdint>
#include <expected>

#include "board.h"
#include "clock.h"
#include "semihosting.h"
#include "text.h"
#include "tm485/bus/bus.hpp"
#include "tm485/mcu/direction.hpp"
#include "tm485/mcu/nrf51_uart.hpp"
#include "tm485/mcu/polled_uart_port.hpp"
#include "tm485/mcu/register_access.hpp"
#include "tm485/motion/estimator_fixed.hpp"
#include "tm485/protocol/profile.hpp"

namespace {

using tm485::Time;

struct DriverPin {
  bool operator()(bool on) const noexcept {
    board_drive(on);
    return true;
  }
};
using Uart = tm485::mcu::Nrf51Uart<tm485::mcu::VolatileRegisters>;
using Port = tm485::mcu::PolledUartPort<Uart, tm485::mcu::CallDirection<DriverPin>>;

constexpr tm485::CompiledProfile kProfile = *tm485::CompiledProfile::compile(tm485::Profile{});
constexpr auto kDivisor = *Uart::divisor_for(BOARD_ENCODER_BIT_RATE);

/// 15 Hz at 5 ms, printed by tm485::design::solve_for_bandwidth; in integers by the compiler, so that no floating point
/// comes into the program.
constexpr tm485::FixedGains kGains = *tm485::FixedGains::from({
    .period = std::chrono::milliseconds(5),
    .order = 3,
    .longest_gap = 32,
    .gain = {0.434364766F, 0.122919776F, 0.0173923783F},
    .covariance = {0.0361970626F, 0.0102433152F, 0.00144936482F, 0.00482595898F, 0.000959232741F,
                   0.0002926827F},
    .process_noise = 4.45656478e-05F,
    .measurement_variance = 0.0833333358F,
});

/// A line of text: collected, then printed in one go.
class Line {
 public:
  Line& text(const char* text) noexcept {
    put_text(&out_, text);
    return *this;
  }
  Line& number(std::int64_t number) noexcept {
    put_number(&out_, number);
    return *this;
  }
  void print() noexcept {
    text("\n");
    text_[count_] = '\0';
    host_print(text_);
    count_ = 0;
  }

 private:
  static void put(void* context, char character) noexcept {
    Line& line = *static_cast<Line*>(context);
    if (line.count_ < sizeof line.text_ - 1) line.text_[line.count_++] = character;
  }

  char text_[160];
  std::uint8_t count_ = 0;
  text_out out_{put, this};
};

struct Parameters {
  std::uint32_t period_ns = 5'000'000;
  std::uint32_t allowance_ns = 20'000'000;
  std::uint32_t cycles = 2000;
};

/// From the command line; false if a word of it is no number.
bool read_parameters(Parameters& parameters) noexcept {
  char line[80];
  host_command_line(line, sizeof line);
  const char* at = line;
  const char* word = nullptr;
  (void)next_word(&at, &word);  // the program's name
  for (std::uint32_t* const wanted : {&parameters.period_ns, &parameters.allowance_ns, &parameters.cycles}) {
    const std::size_t count = next_word(&at, &word);
    if (count == 0) return true;
    if (!word_to_number(word, count, wanted)) return false;
  }
  return true;
}

void show(Line& line, const tm485::FixedEstimate& shaft, const tm485::Sample& sample) noexcept {
  line.text("position ").number(shaft.position).text(" counts, velocity ").number(shaft.velocity >> 8);
  line.text(" counts/s, turn ").number(sample.turns());
  line.text(shaft.valid() ? ", valid" : ", invalid").text(", at ").number(shaft.time.count() / 1000);
  line.text(" us").print();
}

int account(Line& line, const tm485::Statistics& statistics, bool valid) noexcept {
  line.text("cycles ").number(statistics.cycles).text(", good ").number(statistics.good);
  line.text(", failed ").number(statistics.failed).text(", lost ").number(statistics.lost).print();
  for (std::size_t i = 0; i < statistics.errors.size(); ++i) {
    if (statistics.errors[i] == 0) continue;
    const tm485::ErrorInfo& info = tm485::describe(static_cast<tm485::Errc>(i));
    // The texts of the table end with NUL.
    line.number(statistics.errors[i]).text(" ").text(info.name.data()).print();
  }
  return valid ? 0 : 3;
}

}  // namespace

// Nothing here is switched on.
extern "C" void on_bus_timer() {}
extern "C" void on_control() {}
extern "C" void on_encoder_uart() {}

int main() {
  Line line;
  Parameters parameters;
  if (!read_parameters(parameters)) {
    line.text("error: usage: minimal [PERIOD_NS [ALLOWANCE_NS [CYCLES]]]").print();
    return 2;
  }
  clock_start();
  const auto now = [] { return Time{clock_now()}; };

  Port port(Uart(tm485::mcu::VolatileRegisters(std::uintptr_t{BOARD_ENCODER_UART})), {},
            {.stuck_after = Time{parameters.allowance_ns},
             .capability = {.latency_allowance = Time{parameters.allowance_ns},
                            .timing = tm485::TimingClass::hard}});
  tm485::BusConfig config;
  config.cycle = tm485::Cycle{.id = tm485::DataId::everything, .period = Time{parameters.period_ns}};
  config.max_hold = Time{std::int64_t{16} * parameters.period_ns + std::int64_t{2} * parameters.allowance_ns};
  tm485::Bus bus(port, kProfile, config);
  if (!port.start(kDivisor)) {
    line.text("error: the UART does not answer").print();
    return 2;
  }
  if (const auto started = bus.start(now()); !started) {
    line.text("error: refused, ").text(tm485::describe(started.error().code).name.data());
    line.text("; nearest possible: ").number(started.error().nearest.count()).text(" ns").print();
    return 2;
  }

  tm485::FixedEstimator estimator(kGains);
  std::uint32_t seen = bus.latest().sequence();
  std::uint32_t show_at = 500;
  while (bus.statistics().cycles < parameters.cycles) {
    bus.poll(now());  // as often as the loop comes round: a reply is taken byte by byte
    const tm485::Sample& sample = bus.latest();
    if (sample.sequence() == seen) continue;
    seen = sample.sequence();
    if (sample.quality() == tm485::Quality::fresh) {
      (void)estimator.update(sample);
    } else if (sample.quality() == tm485::Quality::invalid) {
      estimator.reset();
    }
    if (bus.statistics().cycles >= show_at) {
      show_at += 500;
      show(line, estimator.at(now()), sample);
    }
  }
  return account(line, bus.statistics(), estimator.at(now()).valid());
}
