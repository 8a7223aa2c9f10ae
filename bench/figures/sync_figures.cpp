// tm485_sync_figures: the lock-free types between two cores, and beside other people's queues. Several rounds in turn;
// each row is the median of its rounds with the smallest and the largest.
//
//   tm485_sync_figures [--rounds N] [--fifo] [--json]
#include <cstdio>
#include <cstdlib>
#include <string_view>

#include "harness.hpp"

int main(int argc, char** argv) {
  using namespace tm485::figures;
  int rounds = 7;
  bool json = false;
  bool fifo = false;
  for (int i = 1; i < argc; ++i) {
    const std::string_view argument = argv[i];
    if (argument == "--json") {
      json = true;
    } else if (argument == "--fifo") {
      fifo = true;
    } else if (argument == "--rounds" && i + 1 < argc && std::atoi(argv[i + 1]) > 0) {
      rounds = std::atoi(argv[++i]);
    } else {
      std::fputs(
          "usage: tm485_sync_figures [--rounds N] [--fifo] [--json]\n"
          "  --rounds N  measurements of everything, in turn (7)\n"
          "  --fifo      both threads at SCHED_FIFO, if the system allows it\n",
          stderr);
      return 2;
    }
  }
  const Pair pair(fifo);
  (void)ns_per_tick();
  Table table;
  for (int round = 0; round < rounds; ++round) {
    measure_rings(pair, table);
    measure_latest(pair, table);
  }
  add_ring_ratios(table);
  if (json) {
    std::fputs(table.json().c_str(), stdout);
    return 0;
  }
  if (pair.pinned())
    std::printf("cores %d and %d", pair.cores().first, pair.cores().second);
  else
    std::printf("not pinned: fewer than two cores");
  std::printf(", %s, %d rounds, items of %zu bytes\n\n%s", pair.fifo() ? "SCHED_FIFO" : "SCHED_OTHER", rounds,
              sizeof(Item), table.text().c_str());
  return 0;
}
