#include "tm485/sim/fault_player.hpp"

#include <algorithm>
#include <cmath>

#include "tm485/sim/encoder_model.hpp"
#include "tm485/sim/faults.hpp"
#include "tm485/sim/line.hpp"

namespace tm485::sim {
namespace {

/// A restart is announced to the encoder so long before it comes: longer than any reply, so that it cuts it.
constexpr Time kLookAhead = std::chrono::milliseconds(1);

/// The host's receiver loses one character of a reply.
class Overrun final : public FaultHook {
 public:
  Overrun(Line& line, std::uint64_t seed) noexcept : line_{&line}, random_{seed} {}
  bool on_burst(Burst& burst) noexcept override {
    if (burst.talker != Talker::encoder || burst.count == 0) return false;
    const auto lost = static_cast<std::size_t>(random_.below(burst.count));
    std::copy(burst.bytes.begin() + static_cast<std::ptrdiff_t>(lost) + 1, burst.bytes.begin() + burst.count,
              burst.bytes.begin() + static_cast<std::ptrdiff_t>(lost));
    --burst.count;
    line_->overrun_host();
    return true;
  }

 private:
  Line* line_;
  Random random_;
};

/// Replies and characters by one fault, requests by another: together they are the fault `lose`.
class Lose final : public FaultHook {
 public:
  Lose(double replies, double characters, double requests, std::uint64_t seed) noexcept
      : others_{replies, characters, seed}, requests_{requests, seed + 1}, has_requests_{requests > 0.0} {}
  bool on_burst(Burst& burst) noexcept override {
    const bool lost = has_requests_ && requests_.on_burst(burst);
    return others_.on_burst(burst) || lost;
  }

 private:
  LostCharacters others_;
  LostRequests requests_;
  bool has_requests_;
};

FaultSide side_of(double value) { return static_cast<FaultSide>(static_cast<int>(value)); }

/// A seed for the fault at one place of the plan, far from those of its neighbours.
std::uint64_t seed_of(const FaultLine& line, std::uint64_t seed, std::size_t place) {
  if (line.seed) return *line.seed;
  Random mixed{seed + 0x632BE59BD9B4E019u * (place + 1)};
  return mixed.next();
}

}  // namespace

FaultPlayer::FaultPlayer(const FaultPlan& plan, std::uint64_t seed, const Stage& stage) : stage_{stage} {
  if (stage.distortion != nullptr) plain_ = stage.distortion->config();
  if (stage.line != nullptr) plain_echo_ = stage.line->echo();
  if (stage.encoder != nullptr) {
    plain_sf_ = stage.encoder->config().sf;
    plain_almc_ = stage.encoder->config().almc;
  }
  faults_.reserve(plan.lines().size());
  for (std::size_t place = 0; place < plan.lines().size(); ++place) {
    const FaultLine& line = plan.lines()[place];
    Fault& fault = faults_.emplace_back();
    fault.line = line;
    fault.changes_bits = info_of(line.kind).changes_bits;
    const std::uint64_t own_seed = seed_of(line, seed, place);
    make_hook(fault, own_seed);
    if (info_of(line.kind).by_chance && (line.probability < 1.0 || line.every > Time{0})) {
      fault.trigger.emplace(line.probability, line.every, line.from, own_seed + 7);
      fault.triggered = true;
    }
  }
  active_.reserve(faults_.size());
  for (Fault& fault : faults_) {
    if (fault.line.kind == FaultKind::restart) restarts_.push_back(&fault);
    if (fault.speaks) speakers_.push_back(&fault);
  }
  for (Fault* const fault : restarts_) {
    fault->next = fault->line.from;
    next_restart_ = std::min(next_restart_, fault->next);
  }
  find_next_own();
}

FaultPlayer::~FaultPlayer() = default;

void FaultPlayer::make_hook(Fault& fault, std::uint64_t seed) const {
  const auto& value = fault.line.values;
  const Time character = stage_.character_time;
  const auto time = [](double ns) { return Time{std::llround(ns)}; };
  switch (fault.line.kind) {
    case FaultKind::bits:
      fault.hook = std::make_unique<BitErrors>(value[0], value[1], seed);
      break;
    case FaultKind::burst:
      fault.side = side_of(value[1]);
      fault.hook = std::make_unique<BurstErrors>(static_cast<unsigned>(value[0]), fault.side, seed);
      break;
    case FaultKind::stuck:
      fault.side = side_of(value[2]);
      fault.hook =
          std::make_unique<StuckColumn>(static_cast<unsigned>(value[0]), value[1] != 0.0, fault.side);
      break;
    case FaultKind::lose:
      fault.hook = std::make_unique<Lose>(value[0], value[1], value[2], seed);
      break;
    case FaultKind::extra:
      fault.hook = std::make_unique<ExtraCharacters>(value[0], side_of(value[1]), seed);
      break;
    case FaultKind::late:
      fault.side = FaultSide::replies;
      fault.hook = std::make_unique<BrokenReply>(time(value[0]), character, seed);
      fault.speaks = true;
      break;
    case FaultKind::t2:
      fault.side = FaultSide::replies;
      fault.hook = std::make_unique<OtherT2>(time(value[0]), character);
      break;
    case FaultKind::wrong_cf:
      fault.side = FaultSide::replies;
      fault.hook = std::make_unique<WrongCf>(seed);
      break;
    case FaultKind::overrun:
      fault.side = FaultSide::replies;
      if (stage_.line != nullptr) fault.hook = std::make_unique<Overrun>(*stage_.line, seed);
      break;
    case FaultKind::late_release:
      fault.side = FaultSide::requests;
      fault.hook = std::make_unique<LateRelease>(time(value[0]));
      break;
    case FaultKind::talker:
    case FaultKind::babble: {
      const bool babbles = fault.line.kind == FaultKind::babble;
      fault.hook = std::make_unique<OtherTalker>(
          babbles ? unsigned{Burst::kCapacity} : static_cast<unsigned>(value[1]),
          babbles ? Time{0} : time(value[0]), character, fault.line.from, fault.line.until, seed);
      fault.speaks = true;
      break;
    }
    case FaultKind::noise:
    case FaultKind::swapped:
    case FaultKind::baud:
    case FaultKind::echo:
    case FaultKind::restart:
    case FaultKind::alarm:
    case FaultKind::frozen:
      break;
  }
}

void FaultPlayer::find_next_own() noexcept {
  next_own_ = kNever;
  for (Fault* const fault : speakers_) {
    const Time next = fault->hook->next_own();
    if (next >= next_own_) continue;
    next_own_ = next;
    speaker_ = fault;
  }
}

void FaultPlayer::touch(Time until, bool bits_changed) noexcept {
  effects_.touched = true;
  effects_.bits_changed = effects_.bits_changed || bits_changed;
  if (bits_changed) effects_.last_change = std::max(effects_.last_change, until);
  if (until <= effects_.last) return;
  effects_.last = until;
  effects_.restarted = until <= restarted_until_;
}

bool FaultPlayer::on_own(Burst& burst) noexcept {
  if (speaker_ == nullptr) return false;
  const bool speaks = speaker_->hook->on_own(burst);
  const bool foreign = burst.talker == Talker::third;
  // The rest of a reply that comes when the next request has been sent is part of another exchange as well.
  const bool meets = speaks && (foreign || speaker_->broke_in != cycles_);
  if (speaks && foreign) {
    ++speaker_->hits;
    talker_until_ = std::max(talker_until_, burst.driver_off);
  }
  if (speaks) touch(burst.driver_off, meets);
  if (speaks) on_line_until_ = std::max(on_line_until_, burst.driver_off);
  effects_.mixed = effects_.mixed || meets;
  if (speaks && keep_replies_ && burst.talker == Talker::encoder) {  // the rest of a reply
    const auto rest = std::min<unsigned>(burst.count, unsigned{Burst::kCapacity} - last_reply_.count);
    std::copy_n(burst.bytes.begin(), rest, last_reply_.bytes.begin() + last_reply_.count);
    last_reply_.count = static_cast<std::uint8_t>(last_reply_.count + rest);
    last_reply_.driver_off = burst.driver_off;
  }
  find_next_own();
  return speaks;
}

bool FaultPlayer::on_burst(Burst& burst) noexcept {
  if (burst.talker == Talker::host) {
    // What is still on the line from before meets this exchange.
    effects_.touched = effects_.bits_changed = effects_.mixed = on_line_until_ > burst.driver_on;
    effects_.talker_before = talker_until_;
    if (burst.start >= next_window_ || cycles_ >= next_window_cycle_) [[unlikely]]
      look_at_windows(burst.start);
    ++cycles_;
    const Time end = burst.start + stage_.character_time * burst.count;
    if (end + kLookAhead >= next_restart_) [[unlikely]] {
      for (Fault* const fault : restarts_) restart_if_due(*fault, end + kLookAhead);
      // One that came and went while nobody spoke has touched no burst; it has happened all the same.
      if (restarted_until_ < burst.start && restarted_until_ > effects_.last) {
        effects_.last = restarted_until_;
        effects_.restarted = true;
      }
    }
    if (drifting_) [[unlikely]]
      distort(burst.start);
  }
  bool altered = false;
  broken_ = false;
  for (Fault* const fault : active_) altered = apply(*fault, burst) || altered;
  if (lasting_ || restarted_until_ >= burst.start) [[unlikely]]
    note_states(burst);
  if (keep_replies_ && burst.talker == Talker::encoder) last_reply_ = burst;
  return altered;
}

/// Lets one fault act on the burst, if its time has come.
bool FaultPlayer::apply(Fault& fault, Burst& burst) noexcept {
  if (fault.hook == nullptr) return false;
  if (fault.line.kind == FaultKind::t2) static_cast<OtherT2&>(*fault.hook).note_request(burst);
  if (fault.triggered && (!touches(fault.side, burst) || !fault.trigger->fires(burst.start))) return false;
  if (fault.speaks && broken_)
    return false;  // of two pauses the second part of the first would come too soon
  const Time driver_off = burst.driver_off;
  const bool altered = fault.hook->on_burst(burst);
  if (!altered && burst.driver_off == driver_off) return false;
  ++fault.hits;
  const Time until = std::max(driver_off, burst.driver_off);
  touch(until, fault.changes_bits);
  on_line_until_ = std::max(on_line_until_, until);
  effects_.mixed = effects_.mixed || fault.line.kind == FaultKind::late_release;
  if (fault.speaks) {
    broken_ = true;
    fault.broke_in = cycles_;
    find_next_own();
  }
  return altered;
}

/// What lasts has an effect on every exchange, whether or not a burst of it was changed.
void FaultPlayer::note_states(const Burst& burst) noexcept {
  if (lasting_) {
    const bool distorts = stage_.distortion != nullptr && stage_.distortion->distorts();
    touch(burst.driver_off, distorts);
    effects_.mixed = effects_.mixed || distorts || echoes_;
  }
  if (restarted_until_ >= burst.start) touch(restarted_until_, false);
}

/// Opens and closes windows, and finds out when the next one opens or closes.
void FaultPlayer::look_at_windows(Time now) noexcept {
  next_window_ = kNever;
  next_window_cycle_ = FaultLine::kEveryCycle;
  active_.clear();
  bool distorts = false;
  for (Fault& fault : faults_) {
    const FaultLine& line = fault.line;
    for (const Time edge : {line.from, line.until})
      if (edge > now) next_window_ = std::min(next_window_, edge);
    if (line.first_cycle > cycles_) next_window_cycle_ = std::min(next_window_cycle_, line.first_cycle);
    if (line.last_cycle >= cycles_ && line.last_cycle != FaultLine::kEveryCycle)
      next_window_cycle_ = std::min(next_window_cycle_, line.last_cycle + 1);
    const bool active =
        now >= line.from && now < line.until && cycles_ >= line.first_cycle && cycles_ <= line.last_cycle;
    if (active != fault.active) {
      fault.active = active;
      switch_state(fault, active, now);
    }
  }
  // What moves a reply as a whole comes before what breaks it in two.
  for (const bool moves : {true, false})
    for (Fault& fault : faults_)
      if (fault.active && fault.hook != nullptr && (fault.line.kind == FaultKind::t2) == moves)
        active_.push_back(&fault);
  lasting_ = drifting_ = false;
  for (const Fault& fault : faults_) {
    if (!fault.active) continue;
    const FaultKind kind = fault.line.kind;
    distorts = distorts || kind == FaultKind::swapped || kind == FaultKind::baud || kind == FaultKind::noise;
    drifting_ = drifting_ || (kind == FaultKind::baud && fault.line.values[0] != 0.0);
    lasting_ = lasting_ || kind == FaultKind::echo || kind == FaultKind::frozen;
  }
  lasting_ = lasting_ || distorts;
  distort(now);
}

void FaultPlayer::switch_state(Fault& fault, bool on, Time now) noexcept {
  if (on && fault.hook == nullptr && fault.line.kind != FaultKind::restart) ++fault.hits;
  const auto any = [this](FaultKind kind) {
    return std::ranges::any_of(faults_, [kind](const Fault& f) { return f.active && f.line.kind == kind; });
  };
  switch (fault.line.kind) {
    case FaultKind::echo:
      echoes_ = any(FaultKind::echo);
      if (stage_.line != nullptr) stage_.line->set_echo(plain_echo_ || echoes_);
      break;
    case FaultKind::alarm: {
      unsigned almc = plain_almc_;
      for (const Fault& f : faults_)
        if (f.active && f.line.kind == FaultKind::alarm) almc |= static_cast<unsigned>(f.line.values[0]);
      const auto byte = static_cast<std::uint8_t>(almc);
      if (stage_.encoder != nullptr)
        stage_.encoder->set_alarms(static_cast<std::uint8_t>(plain_sf_ | EncoderModel::sf_of(byte)), byte);
      break;
    }
    case FaultKind::frozen:
      effects_.frozen = any(FaultKind::frozen);
      if (stage_.encoder == nullptr) break;
      if (!effects_.frozen) stage_.encoder->sample_fresh();
      if (on) stage_.encoder->sample_stale(now, false);
      break;
    default:
      break;
  }
}

/// Everything that the two ends disagree about, as it is at `now`.
void FaultPlayer::distort(Time now) noexcept {
  if (stage_.distortion == nullptr || stage_.line == nullptr) return;
  DistortionConfig config = plain_;
  double off = 0.0;
  for (const Fault& fault : faults_) {
    if (!fault.active) continue;
    const auto& value = fault.line.values;
    switch (fault.line.kind) {
      case FaultKind::noise:
        config.glitches = 1.0 - (1.0 - config.glitches) * (1.0 - value[0]);
        break;
      case FaultKind::swapped:
        config.swap = value[0] == 0.0 ? Swap::pair : Swap::receive;
        break;
      case FaultKind::baud: {
        const double seconds = std::chrono::duration<double>(now - fault.line.from).count();
        off += std::clamp(value[1] + value[0] * seconds, -value[2], value[2]);
        break;
      }
      default:
        break;
    }
  }
  config.encoder_bits_per_second =
      std::llround(static_cast<double>(plain_.encoder_bits_per_second) * (1.0 + off));
  stage_.distortion->configure(config);
  stage_.line->set_distortion(stage_.distortion->distorts() ? stage_.distortion : nullptr);
}

/// Announces the power failures up to `until`. While the supply is off another one means nothing.
void FaultPlayer::restart_if_due(Fault& fault, Time until) noexcept {
  const Time off{std::llround(fault.line.values[0])};
  const Time again{std::llround(fault.line.values[1])};
  while (fault.next <= until && fault.next < fault.line.until) {
    const Time on = fault.next + off;
    if (fault.next > restarted_until_ && stage_.encoder != nullptr && stage_.encoder->power_off(fault.next)) {
      static_cast<void>(stage_.encoder->power_on(on));
      restarted_until_ = on + stage_.encoder->config().boot_time;
      ++fault.hits;
    }
    fault.next = again > Time{0} ? fault.next + again : kNever;
  }
  next_restart_ = kNever;
  for (const Fault* const other : restarts_) {
    if (other->next < other->line.until) next_restart_ = std::min(next_restart_, other->next);
  }
}

std::uint64_t FaultPlayer::bits_flipped() const noexcept {
  std::uint64_t flipped = 0;
  for (const Fault& fault : faults_)
    if (fault.line.kind == FaultKind::bits)
      flipped += static_cast<const BitErrors&>(*fault.hook).bits_flipped();
  return flipped;
}

}  // namespace tm485::sim
