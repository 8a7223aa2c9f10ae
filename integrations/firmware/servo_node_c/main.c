/* servo_node_c: reads an encoder by interrupts and shows it on a console; ../servo_node is the same in C++.
   docs/firmware.md. */
#include "clock.h"
#include "console.h"
#include "cortex_m.h"
#include "node.h"

int main(void) {
  clock_start();
  if (!console_start()) return 2;
  for (;;) {
    (void)clock_now(); /* before its counter has come round */
    if (console_step()) return 0;
    if (node_running()) wait_for_interrupt(); /* the next interrupt wakes it */
  }
}
