#include "tm485/bus/reset_run.hpp"

#include <algorithm>

namespace tm485 {

ResetRun::ResetRun(const CompiledProfile& profile, const ResetConfig& config) noexcept
    : profile_(&profile), config_(config) {
  const unsigned bits = profile.profile().single_turn_bits;
  if (config_.standstill == 0) config_.standstill = std::max(2U, bits > 15 ? 1U << (bits - 15) : 1U);
  if (config_.tolerance == 0) config_.tolerance = 4 * config_.standstill;
  config_.most_runs = std::max<std::uint8_t>(config_.most_runs, 1);
  config_.max_speed_rpm = std::clamp<std::int32_t>(config_.max_speed_rpm, 1, AxisConfig::kFastest);
}

std::expected<void, Errc> ResetRun::start(ResetKind kind) noexcept {
  if (active()) return std::unexpected(Errc::busy);
  kind_ = kind;
  stage_ = Stage::before;
  seen_before_ = false;
  tries_ = 0;
  busy_looks_ = 0;
  sent_ = 0;
  wait_until_ = Time{0};
  result_ = {};
  result_.kind = kind;
  outcome_.reset();
  cause_ = Errc::timeout;
  return {};
}

std::optional<Request> ResetRun::next(Time now) noexcept {
  if (!active() || under_way_ || now < wait_until_) return std::nullopt;
  under_way_ = true;
  return *Request::make(stage_ == Stage::run ? reset_id(kind_) : DataId::everything);
}

void ResetRun::on_refused(Errc cause, Time now) noexcept {
  under_way_ = false;
  if (cause == Errc::no_gap) return end(ResetVerdict::refused, cause);
  if (cause == Errc::busy && ++busy_looks_ <= kMostBusy) {  // somebody else's request, and soon over
    wait_until_ = now + kBusyPause;
    return;
  }
  on_failure(cause, now);
}

void ResetRun::on_completion(const Completion& completion, Time now) noexcept {
  under_way_ = false;
  if (!active()) return;
  if (!completion.result) return on_failure(completion.result.error(), now);
  on_reply(completion.result->frame(), now);
}

void ResetRun::on_failure(Errc cause, Time now) noexcept {
  cause_ = cause;
  // Against noise at once, against an encoder that boots slowly.
  wait_until_ = now + (tries_ < 3 ? Time{0} : profile_->profile().power_up_time / 4);
  if (stage_ == Stage::run) {
    // It may have counted this one, or not: another request makes it forget.
    stage_ = Stage::interrupt;
    if (result_.runs >= config_.most_runs) return end(ResetVerdict::failed, cause);
  }
  if (++tries_ > kMostTries) end(ResetVerdict::failed, cause);
}

void ResetRun::on_reply(const Frame& frame, Time now) noexcept {
  tries_ = 0;
  busy_looks_ = 0;
  switch (stage_) {
    case Stage::before:
      return look_before(frame, now);
    case Stage::interrupt:
      return begin_run(now);
    case Stage::run: {
      const Profile& p = profile_->profile();
      if (++sent_ < p.reset_count) return;
      stage_ = Stage::verify;
      done_at_ = now;
      wait_until_ = now + (kind_ == ResetKind::zero ? p.reset_zero_settle + kLookEvery : kLookEvery);
      return;
    }
    case Stage::verify:
      return judge(frame, now);
    case Stage::idle:
      return;
  }
}

void ResetRun::begin_run(Time now) noexcept {
  stage_ = Stage::run;
  sent_ = 0;
  ++result_.runs;
  wait_until_ = now;
}

/// What ID3 says before; for zero, over a window, whether the shaft stands still.
void ResetRun::look_before(const Frame& frame, Time now) noexcept {
  if (!seen_before_) {
    seen_before_ = true;
    result_.abs_before = frame.abs();
    result_.turns_before = turns_of(frame);
    result_.status_before = frame.status();
    seen_at_ = now;
    window_end_ = now + config_.window;
  }
  if (kind_ != ResetKind::zero) return begin_run(now);
  if (abs_distance(frame.abs(), result_.abs_before) > static_cast<std::int64_t>(config_.standstill))
    return end(ResetVerdict::refused, Errc::shaft_moves);
  if (now >= window_end_) return begin_run(now);
  wait_until_ = now + kLookEvery;
}

/// How many the shaft can have begun, rounded down: bounded by the tries, so that no product overflows.
std::int64_t ResetRun::turns_since(Time then, Time now) const noexcept {
  constexpr Time kMinute = std::chrono::minutes(1);
  return std::clamp(now - then, Time{0}, kMinute).count() * config_.max_speed_rpm / kMinute.count();
}

void ResetRun::judge(const Frame& frame, Time now) noexcept {
  const Profile& p = profile_->profile();
  result_.abs_after = frame.abs();
  result_.turns_after = turns_of(frame);
  result_.status_after = frame.status();
  if (kind_ == ResetKind::zero) {
    const bool at_zero = abs_distance(frame.abs(), 0) <= static_cast<std::int64_t>(config_.tolerance);
    return at_zero ? end(ResetVerdict::verified) : end(ResetVerdict::refused, Errc::reset_without_effect);
  }
  if (kind_ == ResetKind::multi_turn && p.multi_turn_bits != 0) {
    const auto distance = [&](std::int32_t from) {
      const std::uint32_t turns =
          static_cast<std::uint32_t>(result_.turns_after) - static_cast<std::uint32_t>(from);
      const std::int64_t signed_turns = Frame::sign_extend(turns, p.multi_turn_bits);
      return signed_turns < 0 ? -signed_turns : signed_turns;
    };
    // A shaft that stands on the seam of two turns may have crossed it.
    const std::int64_t off = distance(p.multi_turn_start);
    if (off > 1 + turns_since(done_at_, now)) return end(ResetVerdict::refused, Errc::reset_without_effect);
    // What no shaft has made is the reset; otherwise they say neither yes nor no.
    const bool changed = distance(result_.turns_before) > 1 + turns_since(seen_at_, now);
    if (off > 1 && !changed)
      return result_.runs < config_.most_runs ? begin_run(now) : end(ResetVerdict::failed, cause_);
  }
  // What the document reserves is no alarm.
  const StatusSet reserved = p.reserved_status;
  const StatusSet left(static_cast<std::uint8_t>(frame.status().sf() & ~reserved.sf()),
                       static_cast<std::uint8_t>(frame.status().almc() & ~reserved.almc()));
  result_.persisting = left;
  // Bits that the profile's policy ignores (those of a battery that is not there) are named, but no failure.
  const bool good = left.empty() || p.alarms.level(left) == AlarmLevel::none;
  end(good ? ResetVerdict::verified : ResetVerdict::cause_persists);
}

void ResetRun::end(ResetVerdict verdict, Errc code) noexcept {
  result_.verdict = verdict;
  result_.code = code;
  outcome_ = result_;
  stage_ = Stage::idle;
}

std::int64_t ResetRun::abs_distance(std::uint32_t a, std::uint32_t b) const noexcept {
  const std::int64_t distance = Frame::sign_extend(a - b, profile_->profile().single_turn_bits);
  return distance < 0 ? -distance : distance;
}

std::int32_t ResetRun::turns_of(const Frame& frame) const noexcept {
  const unsigned bits = profile_->profile().multi_turn_bits;
  return bits == 0 ? 0 : frame.turns(bits);
}

}  // namespace tm485
