// How large a probability can be that was counted.
#pragma once

#include <cstdint>

namespace tm485::cli::doctor {

/// The upper end of the one-sided 95 % interval (Clopper and Pearson, exact) for the probability of an event that was
/// seen `events` times in `trials` > 0 independent trials.
[[nodiscard]] double upper_bound_95(std::uint32_t events, std::uint32_t trials);

}  // namespace tm485::cli::doctor
