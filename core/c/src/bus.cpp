// The bus.
#include "tm485/c/bus.h"

#include <cstddef>
#include <cstdint>
#include <new>
#include <optional>
#include <type_traits>

#include "convert.hpp"
#include "handles.hpp"
#include "tm485/bus/bus.hpp"

template class tm485::Bus<tm485::c::CPort>;

namespace tm485::c {
namespace {

using Kind = CycleRecord::Kind;

static_assert(std::has_unique_object_representations_v<tm485_bus_config> &&
              std::has_unique_object_representations_v<tm485_refusal> &&
              std::has_unique_object_representations_v<tm485_feasibility> &&
              std::has_unique_object_representations_v<tm485_completion> &&
              std::has_unique_object_representations_v<tm485_link_health> &&
              std::has_unique_object_representations_v<tm485_alarms> &&
              std::has_unique_object_representations_v<tm485_record>);
static_assert(kFits<tm485_bus, BusContent>);
static_assert(Pattern::kMaxSteps == TM485_MAX_STEPS);
static_assert(value(Phase::Kind::any) == TM485_PHASE_ANY && value(Phase::Kind::epoch) == TM485_PHASE_EPOCH &&
              value(Phase::Kind::servo) == TM485_PHASE_SERVO);
static_assert(value(BusState::stopped) == TM485_STATE_STOPPED &&
              value(BusState::startup) == TM485_STATE_STARTUP &&
              value(BusState::running) == TM485_STATE_RUNNING);
static_assert(value(StartupStage::quiet) == TM485_STAGE_QUIET &&
              value(StartupStage::answer) == TM485_STAGE_ANSWER &&
              value(StartupStage::identify) == TM485_STAGE_IDENTIFY &&
              value(StartupStage::cross_check) == TM485_STAGE_CROSS_CHECK &&
              value(StartupStage::consistent) == TM485_STAGE_CONSISTENT &&
              value(StartupStage::done) == TM485_STAGE_DONE);
static_assert(value(LinkState::good) == TM485_LINK_GOOD &&
              value(LinkState::degraded) == TM485_LINK_DEGRADED && value(LinkState::lost) == TM485_LINK_LOST);
static_assert(value(Kind::startup) == TM485_RECORD_STARTUP && value(Kind::cyclic) == TM485_RECORD_CYCLIC &&
              value(Kind::background) == TM485_RECORD_BACKGROUND);

}  // namespace

std::optional<BusConfig> from_c(const tm485_bus_config& config) noexcept {
  const auto axis = from_c(config.axis);
  if (!axis || config.phase > TM485_PHASE_SERVO || config.step_count > TM485_MAX_STEPS) return std::nullopt;
  BusConfig bus;
  bus.cycle.reset();
  if (config.step_count != 0) {
    Pattern& pattern = bus.cycle.emplace(Time{config.slot}, std::initializer_list<PatternRun>{});
    for (std::size_t i = 0; i < config.step_count; ++i) {
      if (!is_data_id(config.steps[i].id)) return std::nullopt;
      pattern.add({static_cast<DataId>(config.steps[i].id), config.steps[i].slots});
    }
  }
  bus.phase = {.kind = static_cast<Phase::Kind>(config.phase),
               .epoch = Time{config.epoch},
               .servo = {.period = Time{config.servo_period}, .lead = Time{config.servo_lead}}};
  bus.steal_every = config.steal_every;
  bus.eeprom_may_hold = config.eeprom_may_hold != 0;
  bus.axis = *axis;
  bus.max_hold = Time{config.max_hold};
  bus.startup_frames = config.startup_frames;
  bus.lost_after = Time{config.lost_after};
  bus.link = {.window = config.link_window,
              .degraded_at = config.degraded_at,
              .good_below = config.good_below,
              .lost_after = config.link_lost_after};
  bus.alarm_debounce = config.alarm_debounce;
  return bus;
}

tm485_errc answer(const std::expected<Feasibility, CycleRefusal>& checked, tm485_feasibility* feasibility,
                  tm485_refusal* refusal) noexcept {
  if (!checked) return answer(std::expected<void, CycleRefusal>(std::unexpect, checked.error()), refusal);
  if (feasibility != nullptr) {
    *feasibility = {.slot = checked->slot.count(),
                    .length = checked->length.count(),
                    .slack = checked->slack.count(),
                    .gap = checked->gap.count(),
                    .ready = checked->ready.count(),
                    .free_running = flag(checked->free_running),
                    .reserved = {}};
  }
  return TM485_OK;
}

tm485_errc answer(const std::expected<void, CycleRefusal>& started, tm485_refusal* refusal) noexcept {
  if (started) return TM485_OK;
  const CycleRefusal& why = started.error();
  if (refusal != nullptr)
    *refusal = {.nearest = why.nearest.count(), .code = code(why.code), .step = why.step, .reserved = {}};
  return code(why.code);
}

}  // namespace tm485::c

using namespace tm485::c;
using tm485::Time;

size_t tm485_bus_size(void) { return sizeof(BusContent); }

void tm485_bus_config_default(tm485_bus_config* config) {
  const tm485::BusConfig bus;
  *config = {};
  tm485_axis_config_default(&config->axis);
  tm485_bus_config_cycle(config, TM485_ID_EVERYTHING, 0);
  config->max_hold = bus.max_hold.count();
  config->lost_after = bus.lost_after.count();
  config->steal_every = bus.steal_every;
  config->eeprom_may_hold = flag(bus.eeprom_may_hold);
  config->startup_frames = bus.startup_frames;
  config->link_window = bus.link.window;
  config->degraded_at = bus.link.degraded_at;
  config->good_below = bus.link.good_below;
  config->link_lost_after = bus.link.lost_after;
  config->alarm_debounce = bus.alarm_debounce;
}

void tm485_bus_config_cycle(tm485_bus_config* config, tm485_data_id id, tm485_time slot) {
  config->slot = slot;
  config->steps[0] = {id, 1};
  config->step_count = 1;
}

void tm485_bus_config_add(tm485_bus_config* config, tm485_data_id id, uint8_t times, uint8_t slots) {
  for (unsigned i = 0; i < times && config->step_count <= TM485_MAX_STEPS; ++i) {
    if (config->step_count < TM485_MAX_STEPS) config->steps[config->step_count] = {id, slots};
    ++config->step_count;
  }
}

tm485_errc tm485_bus_init(tm485_bus* bus, const tm485_port* port, const tm485_profile* profile,
                          const tm485_bus_config* config) {
  if (bus == nullptr || profile == nullptr || config == nullptr || !complete(port) || !aligned(bus))
    return TM485_ERR_BAD_ARGUMENT;
  const auto converted = from_c(*config);
  if (!converted) return TM485_ERR_BAD_ARGUMENT;
  auto* const content = ::new (static_cast<void*>(bus->storage)) BusContent;
  auto* const made = ::new (static_cast<void*>(content->port)) CPort(*port);
  ::new (static_cast<void*>(content->object)) CBus(*made, profile_in(profile), *converted);
  return TM485_OK;
}

tm485_errc tm485_bus_check(const tm485_bus* bus, tm485_feasibility* feasibility, tm485_refusal* refusal) {
  return answer(bus_in(bus).check(), feasibility, refusal);
}

tm485_errc tm485_bus_start(tm485_bus* bus, tm485_time now, tm485_refusal* refusal) {
  return answer(bus_in(bus).start(Time{now}), refusal);
}

void tm485_bus_stop(tm485_bus* bus) { bus_in(bus).stop(); }

tm485_time tm485_bus_poll(tm485_bus* bus, tm485_time now) { return bus_in(bus).poll(Time{now}).count(); }

void tm485_bus_on_restart(tm485_bus* bus, tm485_time now) { bus_in(bus).on_restart(Time{now}); }

void tm485_bus_on_servo_tick(tm485_bus* bus, tm485_time tick) { bus_in(bus).on_servo_tick(Time{tick}); }

void tm485_bus_latest(tm485_bus* bus, tm485_sample* sample) { to_c(bus_in(bus).latest(), *sample); }

tm485_errc tm485_bus_offer(tm485_bus* bus, const tm485_request* request, uint32_t ticket) {
  const auto parsed = from_c(*request);
  if (!parsed) return TM485_ERR_BAD_ARGUMENT;
  return code(bus_in(bus).offer(*parsed, ticket));
}

bool tm485_bus_take_completion(tm485_bus* bus, tm485_completion* completion) {
  const auto taken = bus_in(bus).take_completion();
  if (!taken) return false;
  *completion = {};
  completion->request = to_c(taken->request);
  completion->ticket = taken->ticket;
  completion->error = taken->result ? tm485_errc{TM485_OK} : code(taken->result.error());
  if (taken->heard) {
    completion->has_reply = 1;
    completion->reply = to_c(*taken->heard, bus_in(bus).profile());
  }
  return true;
}

tm485_time tm485_bus_fresh_until(const tm485_bus* bus) { return bus_in(bus).fresh_until().count(); }

tm485_time tm485_bus_valid_until(const tm485_bus* bus) { return bus_in(bus).valid_until().count(); }

tm485_time tm485_bus_reply_expected(const tm485_bus* bus) { return bus_in(bus).reply_expected().count(); }

void tm485_bus_set_referenced(tm485_bus* bus, bool referenced) { bus_in(bus).set_referenced(referenced); }

tm485_bus_state tm485_bus_get_state(const tm485_bus* bus) { return value(bus_in(bus).state()); }

tm485_startup_stage tm485_bus_startup_stage(const tm485_bus* bus) {
  return value(bus_in(bus).startup_stage());
}

tm485_errc tm485_bus_startup_error(const tm485_bus* bus, tm485_startup_stage* stage) {
  const auto& error = bus_in(bus).startup_error();
  if (!error) return TM485_OK;
  if (stage != nullptr) *stage = value(error->stage);
  return code(error->cause);
}

void tm485_bus_link(const tm485_bus* bus, tm485_link_health* health) {
  using tm485::LinkCause;
  const tm485::LinkHealth& link = bus_in(bus).link();
  *health = {.silence = link.failures(LinkCause::silence),
             .damage = link.failures(LinkCause::damage),
             .implausible = link.failures(LinkCause::implausible),
             .host = link.failures(LinkCause::host),
             .state = value(link.state()),
             .measured = flag(link.measured())};
}

void tm485_bus_alarms(const tm485_bus* bus, tm485_alarms* alarms) {
  const tm485::AlarmMonitor& seen = bus_in(bus).alarms();
  *alarms = {.live = seen.live().bits(),
             .latched = seen.latched().bits(),
             .live_level = value(seen.live_level()),
             .latched_level = value(seen.latched_level())};
}

void tm485_bus_statistics(const tm485_bus* bus, tm485_statistics* statistics) {
  to_c(bus_in(bus).statistics(), *statistics);
}

uint32_t tm485_bus_error_count(const tm485_bus* bus, tm485_errc code) {
  return known(code) ? bus_in(bus).statistics().errors[code] : 0;
}

uint32_t tm485_bus_last_record(const tm485_bus* bus, tm485_record* record) {
  const tm485::CycleRecord& last = bus_in(bus).last_record();
  if (record != nullptr) {
    *record = {.slot = last.slot.count(),
               .start = last.start.count(),
               .seen = last.seen.count(),
               .reply_delay = last.reply_delay.count(),
               .result = code(last.result),
               .kind = value(last.kind),
               .id = value(last.id),
               .has_reply_delay = flag(last.has_reply_delay),
               .reserved = {}};
  }
  return bus_in(bus).record_count();
}
