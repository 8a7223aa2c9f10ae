// servo_node: reads an encoder by interrupts and shows it on a console. docs/firmware.md.
#include <optional>

#include "board.h"
#include "clock.h"
#include "console.hpp"
#include "cortex_m.h"
#include "node.hpp"

namespace {

// Made in main(): nothing here needs a constructor before it. Not on main's stack: the interrupts use it.
constinit std::optional<servo_node::Node> node;

}  // namespace

extern "C" void on_bus_timer() { node->on_bus(); }

extern "C" void on_encoder_uart() { node->on_bus(); }

extern "C" void on_control() { node->on_control(); }

int main() {
  clock_start();
  node.emplace();
  servo_node::Console console(*node);
  if (!console.start()) return 2;
  for (;;) {
    (void)clock_now();  // before its counter has come round
    if (const auto code = console.step()) return *code;
    if (node->running()) wait_for_interrupt();  // the next interrupt wakes it
  }
}
