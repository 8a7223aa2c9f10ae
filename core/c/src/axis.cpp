// The axis, and the servo loop's side of it.
#include "tm485/c/axis.h"

#include <cstddef>
#include <cstdint>
#include <new>
#include <optional>
#include <type_traits>

#include "convert.hpp"
#include "handles.hpp"
#include "tm485/bus/axis.hpp"

template class tm485::Axis<tm485::c::CPort>;

namespace tm485::c {
namespace {

using Kind = Command::Kind;

static_assert(std::has_unique_object_representations_v<tm485_command_result> &&
              std::has_unique_object_representations_v<tm485_loop_view>);
static_assert(sizeof(void*) != 8 || std::has_unique_object_representations_v<tm485_axis_setup>);
static_assert(kFits<tm485_axis, AxisContent>);
static_assert(kAxisCommands == TM485_AXIS_COMMANDS);
static_assert(value(SampleValidity::invalid) == TM485_VALIDITY_INVALID &&
              value(SampleValidity::extrapolated) == TM485_VALIDITY_EXTRAPOLATED &&
              value(SampleValidity::fresh) == TM485_VALIDITY_FRESH);
static_assert(value(Kind::exchange) == TM485_COMMAND_EXCHANGE &&
              value(Kind::resume) == TM485_COMMAND_RESUME &&
              value(Kind::set_referenced) == TM485_COMMAND_SET_REFERENCED &&
              value(Kind::unreference) == TM485_COMMAND_UNREFERENCE &&
              value(Kind::restart) == TM485_COMMAND_RESTART);

// The handle of the bus inside is its address.
static_assert(alignof(CBus) <= alignof(tm485_bus) && alignof(tm485_bus) <= alignof(CAxis));

CAxis& axis_in(tm485_axis* axis) noexcept { return object_in<CAxis>(axis); }
const CAxis& axis_in(const tm485_axis* axis) noexcept { return object_in<CAxis>(axis); }

}  // namespace
}  // namespace tm485::c

using namespace tm485::c;
using tm485::Time;

size_t tm485_axis_size(void) { return sizeof(AxisContent); }

void tm485_axis_setup_default(tm485_axis_setup* setup) {
  *setup = {};
  tm485_bus_config_default(&setup->bus);
  setup->statistics_every = tm485::AxisSetup{}.statistics_every.count();
}

tm485_errc tm485_axis_init(tm485_axis* axis, const tm485_port* port, const tm485_profile* profile,
                           const tm485_axis_setup* setup) {
  if (axis == nullptr || profile == nullptr || setup == nullptr || !complete(port) || !aligned(axis))
    return TM485_ERR_BAD_ARGUMENT;
  const auto bus = from_c(setup->bus);
  if (!bus) return TM485_ERR_BAD_ARGUMENT;
  if (setup->gains != nullptr && !tm485_estimator_gains_valid(setup->gains)) return TM485_ERR_BAD_ARGUMENT;

  auto* const content = ::new (static_cast<void*>(axis->storage)) AxisContent;
  auto* const made = ::new (static_cast<void*>(content->port)) CPort(*port);
  auto* const hook =
      ::new (static_cast<void*>(content->hook)) InvalidHook{setup->on_invalid, setup->on_invalid_context};
  tm485::AxisSetup converted;
  converted.bus = *bus;
  if (setup->gains != nullptr) converted.gains = &gains_in(setup->gains);
  if (setup->on_invalid != nullptr) converted.on_invalid = {InvalidHook::forward, hook};
  converted.statistics_every = Time{setup->statistics_every};
  ::new (static_cast<void*>(content->object)) CAxis(*made, profile_in(profile), converted);
  return TM485_OK;
}

tm485_errc tm485_axis_check(const tm485_axis* axis, tm485_feasibility* feasibility, tm485_refusal* refusal) {
  return answer(axis_in(axis).check(), feasibility, refusal);
}

tm485_errc tm485_axis_start(tm485_axis* axis, tm485_time now, tm485_refusal* refusal) {
  return answer(axis_in(axis).start(Time{now}), refusal);
}

void tm485_axis_stop(tm485_axis* axis, tm485_time now) { axis_in(axis).stop(Time{now}); }

tm485_time tm485_axis_poll(tm485_axis* axis, tm485_time now) { return axis_in(axis).poll(Time{now}).count(); }

tm485_bus* tm485_axis_bus(tm485_axis* axis) { return reinterpret_cast<tm485_bus*>(&axis_in(axis).bus()); }

tm485_validity tm485_loop_read(tm485_axis* axis, tm485_time now, tm485_sample* sample) {
  const tm485::LoopState state = axis_in(axis).client().read(Time{now});
  if (sample != nullptr) to_c(*state.sample, *sample);
  return value(state.validity);
}

void tm485_loop_estimate_at(const tm485_axis* axis, tm485_time time, tm485_estimate* estimate) {
  to_c(axis_in(axis).client().estimate_at(Time{time}), *estimate);
}

void tm485_loop_get_view(const tm485_axis* axis, tm485_loop_view* view) {
  const tm485::AxisView& seen = axis_in(axis).client().view();
  *view = {.fresh_until = seen.fresh_until.count(),
           .valid_until = seen.valid_until.count(),
           .startup_cause = code(seen.startup_cause),
           .state = value(seen.state),
           .stage = value(seen.stage),
           .valid = flag(seen.valid),
           .latched = flag(seen.latched),
           .link = value(seen.link),
           .alarm = value(seen.alarm)};
}

void tm485_loop_servo_tick(tm485_axis* axis, tm485_time tick) {
  axis_in(axis).client().servo_tick(Time{tick});
}

tm485_errc tm485_loop_post(tm485_axis* axis, tm485_command command, const tm485_request* request,
                           uint32_t* ticket) {
  if (command > TM485_COMMAND_RESTART) return TM485_ERR_BAD_ARGUMENT;
  auto wanted = tm485::Command::of(static_cast<tm485::Command::Kind>(command));
  if (command == TM485_COMMAND_EXCHANGE) {
    if (request == nullptr) return TM485_ERR_BAD_ARGUMENT;
    const auto parsed = from_c(*request);
    if (!parsed) return TM485_ERR_BAD_ARGUMENT;
    wanted.request = *parsed;
  }
  const auto posted = axis_in(axis).client().post(wanted);
  if (!posted) return code(posted.error());
  if (ticket != nullptr) *ticket = *posted;
  return TM485_OK;
}

bool tm485_loop_poll_completion(tm485_axis* axis, tm485_command_result* result) {
  const auto done = axis_in(axis).client().poll_completion();
  if (!done) return false;
  *result = {};
  result->ticket = done->ticket;
  result->error = code(done->error);
  result->command = value(done->command.kind);
  if (done->command.kind == tm485::Command::Kind::exchange) result->request = to_c(done->command.request);
  if (done->reply) {
    result->has_reply = 1;
    result->reply = to_c(*done->reply, axis_in(axis).bus().profile());
  }
  return true;
}

bool tm485_loop_statistics(const tm485_axis* axis, tm485_statistics* statistics) {
  tm485::Statistics seen;
  if (!axis_in(axis).client().statistics(seen)) return false;
  to_c(seen, *statistics);
  return true;
}
