// The whole of an axis in virtual time, against the encoder model: random patterns, phases, jitter, servo drift,
// background load and faults, judged on every cycle by what the model knows.
//
//   tm485_loop_campaign [CYCLES] [SEED]        the same seed does the same, cycle by cycle
//
// Judged: T1 by the model's count; a sample that is called fresh is the model's latch of that request (where no bit of
// its frame was changed) and is not older than its pattern allows; every posted command completes exactly once;
// statistics add up. A failure prints episode seed and cycle; TM485_EPISODE=seed runs that episode alone.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "tm485/bus/axis.hpp"
#include "tm485/sim/encoder_model.hpp"
#include "tm485/sim/faults.hpp"
#include "tm485/sim/line.hpp"
#include "tm485/sim/sim_port.hpp"

namespace tm485 {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

constexpr std::uint64_t kEpisodeCycles = 20'000;

struct Totals {
  std::uint64_t cycles = 0;
  std::uint64_t good = 0;
  std::uint64_t fresh_reads = 0;
  std::uint64_t extrapolated_reads = 0;
  std::uint64_t invalid_reads = 0;
  std::uint64_t commands = 0;
  std::uint64_t exchanges_done = 0;
  std::uint64_t stolen = 0;
  std::uint64_t displaced = 0;
  std::uint64_t skipped = 0;
  std::uint64_t servo_ticks = 0;
  std::uint64_t torque_offs = 0;
  std::uint64_t startups = 0;
  std::uint64_t changed_and_passed =
      0;  ///< frames with changed bits that every check let pass: the residual of the CRC
  std::uint64_t requests = 0;
  std::uint64_t t1_violations = 0;
  Time smallest_margin = kNever;
};

class Dice {
 public:
  explicit Dice(std::uint64_t seed) : engine_(seed) {}
  std::int64_t below(std::int64_t n) {
    return n <= 0 ? 0 : static_cast<std::int64_t>(engine_() % static_cast<std::uint64_t>(n));
  }
  bool once_in(std::int64_t n) { return below(n) == 0; }
  double unit() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }

 private:
  std::mt19937_64 engine_;
};

/// What an episode is made of, all of it drawn from its seed.
struct Plan {
  std::string profile;
  Pattern pattern;
  Phase phase;
  std::uint16_t steal_every = 0;
  Time start_jitter{0};
  std::int64_t host_late = 0;   ///< ns, of every poll
  std::int64_t stall_once = 0;  ///< one poll in so many comes up to 600 us late; 0: none
  double ppm = 0;               ///< of the servo clock
  std::int64_t tick_jitter = 0;
  double lost_replies = 0;
  double bit_errors = 0;
  std::int64_t outage_once = 0;  ///< one tick in so many begins an outage of up to 60 ms
  std::int64_t commands_once = 0;
  double rpm = 0;
};

Pattern draw_pattern(Dice& dice) {
  const Time slot = microseconds(40) + Time{dice.below(3) == 0 ? 0 : dice.below(60'000)};
  switch (dice.below(6)) {
    case 0:
      return Cycle{DataId::everything, Time{0}};
    case 1:
      return Cycle{DataId::single_turn, slot};
    case 2:
      return Cycle{DataId::everything, Time{62'500} + Time{dice.below(100'000)}};
    case 3:
      return Pattern(slot, {{DataId::single_turn, 6}, {DataId::everything, 1, 2}});
    case 4:
      return Pattern(slot, {{DataId::single_turn, static_cast<std::uint8_t>(1 + dice.below(10))},
                            {DataId::everything, 1, static_cast<std::uint8_t>(2 + dice.below(3))},
                            {DataId::encoder_id, 1},
                            {DataId::multi_turn, 1, static_cast<std::uint8_t>(1 + dice.below(2))}});
    default:
      return Pattern(std::max(slot, Time{62'500}), {{DataId::everything, 3}, {DataId::single_turn, 2}});
  }
}

Plan draw(std::uint64_t seed) {
  Dice dice(seed);
  Plan plan;
  constexpr const char* kProfiles[] = {"tm485_17", "tm485_23", "tformat_17", "tformat_23"};
  plan.profile = kProfiles[dice.below(4)];
  plan.pattern = draw_pattern(dice);
  plan.start_jitter = Time{dice.below(3) * dice.below(2'500)};
  const CompiledProfile profile = *CompiledProfile::compile(*find_profile(plan.profile));
  PortCapability port;
  port.jitter_margin = plan.start_jitter;
  const Feasibility f = Scheduler::make(plan.pattern, profile, port)->feasibility();
  if (const auto kind = dice.below(4); kind == 1) {
    plan.phase = Phase::at(Time{dice.below(1'000'000)});
  } else if (kind >= 2) {
    const std::int64_t ratio = 1 + dice.below(8);
    const Time period = kind == 2 ? f.length * ratio : f.length;
    plan.phase =
        Phase::locked_to({period, std::min(f.ready + Time{dice.below(30'000)}, std::max(period, f.ready))});
    if (!Scheduler::make(plan.pattern, plan.phase, profile, port)) plan.phase = Phase{};
  }
  constexpr std::uint16_t kSteal[] = {0, 0, 1, 4, 16};
  plan.steal_every = kSteal[dice.below(5)];
  plan.host_late = dice.below(2) * dice.below(3'000);
  plan.stall_once = dice.below(3) == 0 ? 200 + dice.below(5'000) : 0;
  plan.ppm = (dice.unit() - 0.5) * 600.0;
  plan.tick_jitter = dice.below(2) * dice.below(4'000);
  plan.lost_replies = dice.below(3) == 0 ? dice.unit() * 0.02 : 0.0;
  plan.bit_errors = dice.below(4) == 0 ? std::pow(10.0, -6.0 + 2.5 * dice.unit()) : 0.0;
  plan.outage_once = dice.below(3) == 0 ? 3'000 + dice.below(20'000) : 0;
  plan.commands_once = 1 + dice.below(30);
  plan.rpm = (dice.unit() - 0.5) * 8'000.0;
  return plan;
}

/// Silences the encoder for a time; what is under way when it begins is not touched.
class Outage : public sim::FaultHook {
 public:
  bool on_burst(sim::Burst& burst) noexcept override {
    if (burst.talker != sim::Talker::encoder || burst.start >= until_) return false;
    burst.count = 0;
    return true;
  }
  void silence(Time until) noexcept { until_ = until; }

 private:
  Time until_{0};
};

class Episode {
 public:
  Episode(std::uint64_t seed, Totals& totals)
      : seed_(seed),
        plan_(draw(seed)),
        dice_(seed + 1),
        totals_(&totals),
        profile_(*CompiledProfile::compile(*find_profile(plan_.profile))),
        model_(encoder_config(), sim::MotionProfile::constant(plan_.rpm, 0.3)),
        line_(&model_, {}),
        port_(line_,
              {.start_jitter = plan_.start_jitter, .jitter_margin = plan_.start_jitter, .seed = seed + 2}),
        bit_errors_(plan_.bit_errors, plan_.bit_errors, seed + 3),
        lost_(plan_.lost_replies, 0.0, seed + 4),
        axis_(port_, profile_, setup()) {
    faults_.add(bit_errors_);
    faults_.add(lost_);
    faults_.add(outage_);
    line_.set_fault_hook(&faults_);
  }

  bool run() {
    if (!axis_.start(now_)) return fail("the pattern was refused");
    const AxisSetup s = setup();
    const Feasibility f = axis_.bus().scheduler()->feasibility();
    servo_period_ = s.bus.phase.kind == Phase::Kind::servo ? s.bus.phase.servo.period : f.length;
    next_tick_ = static_cast<double>(dice_.below(1'000'000));
    // A sample may be fresh until its successor must be here, which the longest T2 and the port's jitter put off.
    const Time longest_exchange = microseconds(4 + 6 + 44);
    fresh_limit_ = axis_.bus().scheduler()->sample_gap() + longest_exchange + plan_.start_jitter;
    while (axis_.bus().statistics().cycles < kEpisodeCycles && now_ < std::chrono::seconds(60)) {
      if (!step()) return false;
    }
    return finish();
  }

 private:
  [[nodiscard]] sim::EncoderConfig encoder_config() const {
    sim::EncoderConfig config;
    const Profile& p = profile_.profile();
    config.flavour = plan_.profile[1] == 'f' ? sim::Flavour::t_format : sim::Flavour::tm485;
    config.single_turn_bits = p.single_turn_bits;
    config.enid = p.enids.count == 0 ? std::uint8_t{0x11} : p.enids.values[0];
    config.start_turn = p.multi_turn_start;
    config.seed = seed_ + 5;
    return config;
  }
  [[nodiscard]] AxisSetup setup() const {
    AxisSetup s;
    s.bus.cycle = plan_.pattern;
    s.bus.phase = plan_.phase;
    s.bus.steal_every = plan_.steal_every;
    s.bus.max_hold = milliseconds(2);
    s.bus.lost_after = milliseconds(5);
    s.on_invalid = {[](void* totals, Time) { ++static_cast<Totals*>(totals)->torque_offs; }, totals_};
    return s;
  }

  bool fail(const char* what) {
    std::fprintf(stderr, "FAILED: %s\n  TM485_EPISODE=%llu, cycle %u, time %lld ns, profile %s\n", what,
                 static_cast<unsigned long long>(seed_), axis_.bus().statistics().cycles,
                 static_cast<long long>(now_.count()), plan_.profile.c_str());
    return false;
  }

  /// One event of the bus's context or of the servo clock.
  bool step() {
    const Time tick{static_cast<std::int64_t>(next_tick_)};
    if (tick <= due_) {
      now_ = std::max(now_, tick);
      next_tick_ += static_cast<double>(servo_period_.count()) * (1.0 + plan_.ppm * 1e-6);
      if (!on_tick(tick)) return false;
    }
    Time late{plan_.host_late == 0 ? 0 : dice_.below(plan_.host_late)};
    if (plan_.stall_once != 0 && dice_.once_in(plan_.stall_once)) late += Time{dice_.below(600'000)};
    const Time event = line_.next_event();
    const Time next = std::min(due_, event > now_ ? event : due_);
    if (tick > next) now_ = std::max(now_, next) + late;
    const std::uint32_t records = axis_.bus().record_count();
    due_ = std::min(axis_.poll(now_), Time{static_cast<std::int64_t>(next_tick_)});
    return axis_.bus().record_count() == records || on_record();
  }

  /// The bus has finished an exchange: is its sample what the model latched?
  bool on_record() {
    const CycleRecord& record = axis_.bus().last_record();
    const std::uint64_t flipped = bit_errors_.bits_flipped();
    const bool changed = flipped != flipped_;
    flipped_ = flipped;
    const Sample& sample = axis_.bus().latest();
    const bool new_sample = sample.sequence() != sequence_;
    sequence_ = sample.sequence();
    if (record.kind != CycleRecord::Kind::cyclic) return true;
    if (record.result != Errc::ok && sample.quality() == Quality::fresh)
      return fail("fresh after a failed cycle");
    if (record.result != Errc::ok || sample.quality() != Quality::fresh) return true;
    if (!new_sample) return fail("a good cycle without a new sample");
    const sim::Latch& latch = model_.last_latch();
    const bool same = sample.latch_time() == latch.time && sample.position() == latch.counts &&
                      sample.single_turn() == latch.abs;
    if (same) return true;
    if (!changed) return fail("a fresh sample is not the model's latch");
    ++totals_->changed_and_passed;
    return true;
  }

  /// The loop's context.
  bool on_tick(Time tick) {
    AxisClient& client = axis_.client();
    client.servo_tick(tick + Time{plan_.tick_jitter == 0 ? 0 : dice_.below(plan_.tick_jitter)});
    const LoopState state = client.read(tick);
    const Sample& sample = *state.sample;
    switch (state.validity) {
      case SampleValidity::fresh:
        ++totals_->fresh_reads;
        if (sample.quality() == Quality::invalid) return fail("called fresh, but it is invalid");
        if (sample.age(tick) > fresh_limit_) return fail("called fresh, but it is too old");
        break;
      case SampleValidity::extrapolated:
        ++totals_->extrapolated_reads;
        if (sample.age(tick) > fresh_limit_ + milliseconds(2))
          return fail("called usable, but it is too old");
        break;
      case SampleValidity::invalid:
        ++totals_->invalid_reads;
        break;
    }
    if (state.usable()) was_usable_ = true;
    if (was_usable_ && !state.usable() && dice_.once_in(50)) (void)post(Command::of(Command::Kind::resume));
    if (dice_.once_in(plan_.commands_once)) draw_command();
    if (plan_.outage_once != 0 && dice_.once_in(plan_.outage_once))
      outage_.silence(tick + Time{dice_.below(60'000'000)});
    if (dice_.once_in(3)) return take();
    return true;
  }

  void draw_command() {
    switch (dice_.below(8)) {
      case 0:
        return post(Command::exchange(*Request::make(DataId::encoder_id)));
      case 1:
        return post(Command::exchange(*Request::make(DataId::everything)));
      case 2:
        if (dice_.once_in(8)) return post(Command::exchange(*Request::make(DataId::reset_errors)));
        return post(Command::of(Command::Kind::set_referenced));
      case 3:
        if (dice_.once_in(500)) return post(Command::of(Command::Kind::restart));
        return post(Command::of(Command::Kind::unreference));
      default:
        return post(Command::exchange(*Request::eeprom_read(static_cast<unsigned>(dice_.below(127)))));
    }
  }
  void post(const Command& command) {
    const auto ticket = axis_.client().post(command);
    if (!ticket) return;
    open_.push_back(*ticket);
    ++totals_->commands;
  }
  bool take() {
    while (const auto result = axis_.client().poll_completion()) {
      const auto found = std::find(open_.begin(), open_.end(), result->ticket);
      if (found == open_.end()) return fail("a completion of a command that is not open");
      open_.erase(found);
      const bool exchange = result->command.kind == Command::Kind::exchange;
      if (result->reply.has_value() != (exchange && result->error == Errc::ok))
        return fail("a reply without success");
      if (exchange && result->error == Errc::ok) {
        ++totals_->exchanges_done;
        if (result->reply->frame().id() != result->command.request.id())
          return fail("the reply of another request");
      }
    }
    return true;
  }

  bool finish() {
    axis_.stop(now_);
    if (!take()) return false;
    if (!open_.empty()) return fail("a command that never completed");
    const Statistics& s = axis_.bus().statistics();
    if (s.good + s.failed != s.cycles) return fail("good and failed cycles do not add up");
    Statistics published;
    if (!axis_.client().statistics(published) || published.cycles != s.cycles)
      return fail("other statistics were published");
    if (model_.t1().violations() != 0) return fail("T1 was undercut");
    totals_->t1_violations += model_.t1().violations();
    totals_->smallest_margin = std::min(totals_->smallest_margin, model_.t1().smallest_margin());
    for (const std::uint64_t requests : model_.statistics().requests) totals_->requests += requests;
    totals_->cycles += s.cycles;
    totals_->good += s.good;
    totals_->stolen += s.stolen;
    totals_->displaced += s.displaced;
    totals_->skipped += s.skipped;
    totals_->servo_ticks += s.servo_ticks;
    totals_->startups += s.startups;
    return true;
  }

  std::uint64_t seed_;
  Plan plan_;
  Dice dice_;
  Totals* totals_;
  CompiledProfile profile_;
  sim::EncoderModel model_;
  sim::Line line_;
  sim::SimPort port_;
  sim::BitErrors bit_errors_;
  sim::LostCharacters lost_;
  Outage outage_;
  sim::FaultChain faults_;
  Axis<sim::SimPort> axis_;

  Time now_{0};
  Time due_{0};
  double next_tick_ = 0;  ///< ns
  Time servo_period_{0};
  Time fresh_limit_{0};
  std::uint64_t flipped_ = 0;
  std::uint32_t sequence_ = 0;
  bool was_usable_ = false;
  std::vector<std::uint32_t> open_;
};

int run(std::uint64_t cycles, std::uint64_t seed) {
  Totals totals;
  if (const char* only = std::getenv("TM485_EPISODE")) {
    seed = std::strtoull(only, nullptr, 10);
    cycles = 1;
  }
  std::uint64_t episodes = 0;
  for (; totals.cycles < cycles; ++episodes) {
    if (!std::make_unique<Episode>(seed + episodes * 1'000'003, totals)->run()) return 1;
  }
  const auto show = [](const char* name, std::uint64_t value) {
    std::printf("  %-44s %12llu\n", name, static_cast<unsigned long long>(value));
  };
  std::printf("%llu episodes, seed %llu\n", static_cast<unsigned long long>(episodes),
              static_cast<unsigned long long>(seed));
  show("cycles", totals.cycles);
  show("good cycles", totals.good);
  show("requests that the model saw", totals.requests);
  show("T1 violations by the model's count", totals.t1_violations);
  std::printf("  %-44s %12lld ns\n", "smallest T1 beyond the minimum",
              static_cast<long long>(totals.smallest_margin.count()));
  show("reads by the loop: fresh", totals.fresh_reads);
  show("reads by the loop: extrapolated", totals.extrapolated_reads);
  show("reads by the loop: invalid", totals.invalid_reads);
  show("commands, each completed exactly once", totals.commands);
  show("background exchanges that succeeded", totals.exchanges_done);
  show("slots stolen", totals.stolen);
  show("slots displaced by resets", totals.displaced);
  show("slots skipped", totals.skipped);
  show("servo ticks", totals.servo_ticks);
  show("start-ups", totals.startups);
  show("torque-off callbacks", totals.torque_offs);
  show("changed frames that passed every check", totals.changed_and_passed);
  return 0;
}

}  // namespace
}  // namespace tm485

int main(int argc, char** argv) {
  const auto number = [&](int at, std::uint64_t otherwise) {
    return argc > at ? std::strtoull(argv[at], nullptr, 10) : otherwise;
  };
  return tm485::run(number(1, 1'000'000), number(2, 1));
}
