// Reset runs.
#include "tm485/c/reset.h"

#include <cstddef>
#include <new>
#include <type_traits>

#include "convert.hpp"
#include "handles.hpp"
#include "tm485/bus/reset_run.hpp"

namespace tm485::c {
namespace {

static_assert(kFits<tm485_reset, ResetRun>);
static_assert(std::has_unique_object_representations_v<tm485_reset_outcome> &&
              std::has_unique_object_representations_v<tm485_reset_config>);
static_assert(value(ResetKind::errors) == TM485_RESET_ERRORS && value(ResetKind::zero) == TM485_RESET_ZERO &&
              value(ResetKind::multi_turn) == TM485_RESET_MULTI_TURN);
static_assert(value(ResetVerdict::verified) == TM485_VERDICT_VERIFIED &&
              value(ResetVerdict::cause_persists) == TM485_VERDICT_CAUSE_PERSISTS &&
              value(ResetVerdict::refused) == TM485_VERDICT_REFUSED &&
              value(ResetVerdict::failed) == TM485_VERDICT_FAILED);

ResetRun& run_in(tm485_reset* reset) noexcept { return object_in<ResetRun>(reset); }
const ResetRun& run_in(const tm485_reset* reset) noexcept { return object_in<ResetRun>(reset); }

}  // namespace
}  // namespace tm485::c

using namespace tm485::c;
using tm485::Time;

size_t tm485_reset_size(void) { return sizeof(tm485::ResetRun); }

void tm485_reset_config_default(tm485_reset_config* config) {
  const tm485::ResetConfig usual;
  *config = {.window = usual.window.count(),
             .standstill = usual.standstill,
             .tolerance = usual.tolerance,
             .most_runs = usual.most_runs,
             .reserved = {},
             .max_speed_rpm = usual.max_speed_rpm};
}

tm485_errc tm485_reset_init(tm485_reset* reset, const tm485_profile* profile,
                            const tm485_reset_config* config) {
  if (reset == nullptr || profile == nullptr || !aligned(reset)) return TM485_ERR_BAD_ARGUMENT;
  tm485::ResetConfig converted;
  if (config != nullptr) {
    converted = {
        .standstill = config->standstill,
        .window = Time{config->window},
        .tolerance = config->tolerance,
        .max_speed_rpm = config->max_speed_rpm != 0 ? config->max_speed_rpm : converted.max_speed_rpm,
        .most_runs = config->most_runs};
  }
  ::new (static_cast<void*>(reset->storage)) tm485::ResetRun(profile_in(profile), converted);
  return TM485_OK;
}

tm485_errc tm485_reset_start(tm485_reset* reset, tm485_reset_kind kind) {
  if (kind > TM485_RESET_MULTI_TURN) return TM485_ERR_BAD_ARGUMENT;
  return code(run_in(reset).start(static_cast<tm485::ResetKind>(kind)));
}

tm485_time tm485_reset_drive(tm485_reset* reset, tm485_bus* bus, tm485_time now) {
  return tm485::drive(run_in(reset), bus_in(bus), Time{now}).count();
}

bool tm485_reset_active(const tm485_reset* reset) { return run_in(reset).active(); }

bool tm485_reset_get_outcome(const tm485_reset* reset, tm485_reset_outcome* outcome) {
  const auto& ended = run_in(reset).outcome();
  if (!ended) return false;
  *outcome = {.abs_before = ended->abs_before,
              .abs_after = ended->abs_after,
              .turns_before = ended->turns_before,
              .turns_after = ended->turns_after,
              .status_before = ended->status_before.bits(),
              .status_after = ended->status_after.bits(),
              .persisting = ended->persisting.bits(),
              .code = code(ended->code),
              .verdict = value(ended->verdict),
              .runs = ended->runs,
              .reserved = {}};
  return true;
}
