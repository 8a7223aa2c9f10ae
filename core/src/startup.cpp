#include "tm485/bus/startup.hpp"

#include <algorithm>
#include <array>

namespace tm485 {
namespace {

/// Between two questions to an encoder that does not answer: rarely enough to leave a host some time, often enough that
/// start-up is through within 20 cycles of the shortest, 40 us, from the moment that it answers.
constexpr Time kAskAgain = std::chrono::microseconds(250);

}  // namespace

std::string_view name(StartupStage stage) noexcept {
  constexpr std::array<std::string_view, 6> kNames{"quiet",       "answer",     "identify",
                                                   "cross_check", "consistent", "done"};
  return kNames[static_cast<std::size_t>(stage) % kNames.size()];
}

Startup::Startup(const CompiledProfile& profile, PositionTracker& tracker, std::uint8_t frames) noexcept
    : profile_(&profile), tracker_(&tracker), frames_wanted_(std::max<std::uint8_t>(frames, 2)) {}

void Startup::begin(Time now, Time latency) noexcept {
  stage_ = StartupStage::quiet;
  failed_ = false;
  retries_ = 0;
  frames_seen_ = 0;
  last_error_ = Errc::ok;
  // As long as the longest reply, and as the longest T1: whoever used the line before may have sent a request.
  quiet_span_ =
      std::max(profile_->exchange_max(DataId::everything), profile_->t1(DataId::everything)) + latency;
  due_ = now + quiet_span_;
  give_up_ = due_ + profile_->profile().power_up_time;
}

void Startup::on_noise(Errc cause, Time now) noexcept {
  if (stage_ != StartupStage::quiet || failed_) return;
  if (now >= give_up_) return fail(cause);
  due_ = now + quiet_span_;
}

void Startup::on_quiet_time(Time now) noexcept {
  if (stage_ != StartupStage::quiet || failed_) return;
  enter(StartupStage::answer);
  due_ = now;
  give_up_ = now + profile_->profile().power_up_time;
}

void Startup::enter(StartupStage stage) noexcept {
  stage_ = stage;
  retries_ = 0;
}

void Startup::on_frame(const Frame& frame, Time latch, Time uncertainty, Time now) noexcept {
  due_ = now;
  if (stage_ == StartupStage::answer) {
    enter(StartupStage::identify);
    return;
  }
  const auto reply = Reply::from(frame, *profile_);
  if (!reply) return fail(reply.error());
  switch (stage_) {
    case StartupStage::identify:
      enid_ = frame.enid();
      enter(StartupStage::cross_check);
      break;
    case StartupStage::cross_check:
      if (frame.enid() != enid_) return fail(Errc::enid_inconsistent);
      enter(StartupStage::consistent);
      frames_seen_ = 0;
      check_consistency(*reply, latch, uncertainty);
      break;
    case StartupStage::consistent:
      check_consistency(*reply, latch, uncertainty);
      break;
    default:
      break;
  }
}

void Startup::check_consistency(const Reply& reply, Time latch, Time uncertainty) noexcept {
  if (reply.frame().enid() != enid_) return fail(Errc::enid_inconsistent);
  const Errc seeded = tracker_->seed(reply, latch, uncertainty);
  // Asked again: from the second time on it is believed.
  if (seeded == Errc::status_inconsistent && ++retries_ <= kRetries) return;
  if (seeded != Errc::ok) return fail(Errc::frames_inconsistent);
  if (++frames_seen_ >= frames_wanted_) enter(StartupStage::done);
}

void Startup::on_error(Errc cause, Time now) noexcept {
  if (failed_) return;
  if (stage_ == StartupStage::answer) {
    // Silence says least: keep what else was seen.
    if (cause != Errc::timeout || last_error_ == Errc::ok) last_error_ = cause;
    if (now >= give_up_) return fail(last_error_);
    due_ = now + kAskAgain;
    return;
  }
  if (++retries_ > kRetries) return fail(cause);
  due_ = now + kAskAgain;
}

void Startup::fail(Errc cause) noexcept {
  error_ = StartupError{stage_, cause};
  failed_ = true;
  due_ = kNever;
}

std::optional<StartupError> Startup::take_failure() noexcept {
  if (!failed_) return std::nullopt;
  failed_ = false;
  return error_;
}

}  // namespace tm485
