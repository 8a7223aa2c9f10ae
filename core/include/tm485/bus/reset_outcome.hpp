// What a run of resets (ResetRun) was for, and what came of it. Specification: section 6.
#pragma once

#include <cstdint>

#include "tm485/errc.hpp"
#include "tm485/protocol/control_field.hpp"
#include "tm485/protocol/status.hpp"

namespace tm485 {

enum class ResetKind : std::uint8_t {
  errors,  ///< ID7: latched error bits
  zero,  ///< ID8: the present single-turn position becomes zero; the motor's electrical alignment moves with it
  multi_turn,  ///< IDC: error bits and the turn count
};

[[nodiscard]] constexpr DataId reset_id(ResetKind kind) noexcept {
  return kind == ResetKind::errors ? DataId::reset_errors
         : kind == ResetKind::zero ? DataId::reset_single_turn
                                   : DataId::reset_multi_turn;
}

enum class ResetVerdict : std::uint8_t {
  verified,        ///< done, and read back
  cause_persists,  ///< done, but these bits are set again or still: their cause lasts
  refused,         ///< not begun, or begun without effect: `code` says why
  failed,          ///< the line failed; what the encoder did is not known
};

struct ResetOutcome {
  ResetKind kind = ResetKind::errors;
  ResetVerdict verdict = ResetVerdict::failed;
  Errc code = Errc::ok;  ///< refused: shaft_moves, busy, reset_without_effect; failed: the last error
  StatusSet
      persisting;  ///< error bits that are set again or still; with `verified` only what the policy ignores
  std::uint8_t runs = 0;  ///< runs that were begun: more than one after an interruption

  // What ID3 said before and after.
  std::uint32_t abs_before = 0;
  std::uint32_t abs_after = 0;
  std::int32_t turns_before = 0;
  std::int32_t turns_after = 0;
  StatusSet status_before;
  StatusSet status_after;
};

}  // namespace tm485
