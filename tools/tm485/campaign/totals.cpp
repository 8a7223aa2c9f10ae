#include <algorithm>

#include "campaign/rules.hpp"

namespace tm485::cli::campaign {

void Totals::add(const Totals& other) noexcept {
  for (const auto counter : {&Totals::runs,
                             &Totals::axis_runs,
                             &Totals::mixed_runs,
                             &Totals::slow_runs,
                             &Totals::cycles,
                             &Totals::good,
                             &Totals::failed,
                             &Totals::startups,
                             &Totals::restarts,
                             &Totals::touched,
                             &Totals::changed,
                             &Totals::changed_and_fresh,
                             &Totals::wrong,
                             &Totals::dangerous,
                             &Totals::frozen_and_wrong,
                             &Totals::beyond,
                             &Totals::lost_turns,
                             &Totals::eeprom_reads,
                             &Totals::eeprom_writes,
                             &Totals::eeprom_judged,
                             &Totals::resets,
                             &Totals::resets_verified,
                             &Totals::loop_reads,
                             &Totals::let_go,
                             &Totals::resumed,
                             &Totals::commands,
                             &Totals::estimates,
                             &Totals::phases})
    this->*counter += other.*counter;
  longest_loss = std::max(longest_loss, other.longest_loss);
  longest_loss_cycles = std::max(longest_loss_cycles, other.longest_loss_cycles);
  for (std::size_t kind = 0; kind < kRecoveries; ++kind) {
    for (std::size_t bin = 0; bin < kRecoveryBins; ++bin) recovered[kind][bin] += other.recovered[kind][bin];
    longest_recovery[kind] = std::max(longest_recovery[kind], other.longest_recovery[kind]);
  }
  longest_startup = std::max(longest_startup, other.longest_startup);
  smallest_t1_margin = std::min(smallest_t1_margin, other.smallest_t1_margin);
}

}  // namespace tm485::cli::campaign
