#include "servo_control.hpp"

#include <cmath>

namespace tm485::cli {
namespace {

/// The one who presses the button comes this long after a torque-off, and again if it was in vain. So too at the
/// start, where a machine that is busy can lose the axis before the loop has seen it.
constexpr Time kResumeAfter = std::chrono::milliseconds(20);

}  // namespace

ServoControl::ServoControl(const ServoSettings& settings, Feedback feedback, AxisClient& client,
                           ControlRing& ring) noexcept
    : settings_(&settings),
      feedback_(feedback),
      client_(&client),
      records_(ring),
      cascade_(settings.cascade),
      counts_per_rev_(static_cast<double>(std::int64_t{1} << settings.profile.profile().single_turn_bits)) {}

void ServoControl::on_tick(Time tick, Time now) noexcept {
  client_->servo_tick(tick);
  while (client_->poll_completion()) {
    // Whether it has helped is seen by what read() answers.
  }
  const LoopState state = client_->read(now);
  if (!state.usable()) {
    if (begun_ == kNever)
      ++periods_.waiting;
    else
      ++periods_.invalid;
    if (begun_ != kNever && state.sample->quality() == Quality::fresh) ++periods_.latched;
    if (holding_) let_go(now);
    ask_to_resume(now);
    return push({.at = now});
  }
  difference(*state.sample);
  if (!holding_) {
    const Estimate shaft = client_->estimate_at(now);
    if (!shaft.valid()) {  // two samples make a velocity
      ++periods_.waiting;
      return push({.at = now});
    }
    take_hold(feedback_ == Feedback::estimator ? shaft.position : state.sample->position(), now);
  }
  if (state.validity == SampleValidity::fresh)
    ++periods_.fresh;
  else
    ++periods_.extrapolated;
  drive(*state.sample, now);
}

void ServoControl::let_go(Time now) noexcept {
  holding_ = false;
  ++torque_offs_;
  last_latch_ = kNever;
  ask_at_ = now + kResumeAfter;
}

void ServoControl::ask_to_resume(Time now) noexcept {
  if (now < ask_at_ || client_->under_way() != 0) return;
  if (client_->post(Command::of(Command::Kind::resume))) ask_at_ = now + kResumeAfter;
}

/// The reference begins where the shaft is: no jump.
void ServoControl::take_hold(std::int64_t position, Time now) noexcept {
  holding_ = true;
  origin_ = position;
  hold_since_ = now;
  if (begun_ == kNever)
    begun_ = now;
  else
    ++recoveries_;
  cascade_.reset();
}

void ServoControl::drive(const Sample& sample, Time now) noexcept {
  const double seconds = static_cast<double>((now - hold_since_).count()) * 1e-9;
  const servo::Setpoint setpoint = reference_at(settings_->reference, seconds);
  // The reference as a whole count and a fraction, as the position is: exact however far the shaft has turned.
  const double way = setpoint.rev * counts_per_rev_;
  const double whole = std::floor(way);
  const std::int64_t reference = origin_ + static_cast<std::int64_t>(whole);
  const Shaft shaft = measure(sample, reference, now);
  const float error_counts = static_cast<float>(way - whole) - shaft.counts;
  const float current =
      cascade_.step(error_counts / static_cast<float>(counts_per_rev_), shaft.rev_per_s, setpoint);
  // An encoder rounds down: on average the shaft is half a count further than it says.
  push({.at = now,
        .current_amperes = current,
        .driving = true,
        .reference_rev = (static_cast<double>(origin_) + way + 0.5) / counts_per_rev_,
        .rev_per_s = shaft.rev_per_s});
}

ServoControl::Shaft ServoControl::measure(const Sample& sample, std::int64_t reference, Time now) noexcept {
  if (feedback_ == Feedback::raw) return {static_cast<float>(sample.position() - reference), raw_rev_per_s_};
  const Estimate shaft = client_->estimate_at(now);
  return {shaft.position_from(reference), shaft.velocity / static_cast<float>(counts_per_rev_)};
}

/// The speed from one sample to the next; without a new sample that of the last two.
void ServoControl::difference(const Sample& sample) noexcept {
  if (sample.latch_time() == last_latch_) return;
  if (last_latch_ != kNever) {
    const auto counts = static_cast<double>(sample.position() - last_position_);
    const auto span = static_cast<double>((sample.latch_time() - last_latch_).count()) * 1e-9;
    raw_rev_per_s_ = static_cast<float>(counts / span / counts_per_rev_);
  } else {
    raw_rev_per_s_ = 0.0F;
  }
  last_position_ = sample.position();
  last_latch_ = sample.latch_time();
}

void ServoControl::push(const ControlRecord& record) noexcept {
  if (!records_.try_push(record)) ++overflows_;
}

}  // namespace tm485::cli
