// What a fault does to one burst, once it acts: a run of wrong bits, a stuck bit, characters too many, a wrong CF.
// When it acts is not decided here (FaultPlayer, FaultTrigger). Specification: sections 1 and 4.
#pragma once

#include <cstdint>

#include "tm485/sim/fault_hook.hpp"
#include "tm485/sim/random.hpp"
#include "tm485/time.hpp"

namespace tm485::sim {

/// Which bursts a fault touches. The third talker's are never touched.
enum class FaultSide : std::uint8_t { requests, replies, both };

[[nodiscard]] constexpr bool touches(FaultSide side, const Burst& burst) noexcept {
  if (burst.talker == Talker::third) return false;
  return side == FaultSide::both || (burst.talker == Talker::host) == (side == FaultSide::requests);
}

/// Acts on some bursts only: on each with a probability, or on the first of every span of time.
class FaultTrigger {
 public:
  /// `probability` 0..1; `every` 0: no span.
  FaultTrigger(double probability, Time every, Time from, std::uint64_t seed) noexcept;

  /// Asked once for each burst that it could act on.
  [[nodiscard]] bool fires(Time start) noexcept {
    if (every_ > Time{0}) {
      if (start < next_) return false;
      next_ += every_ * ((start - next_) / every_ + 1);
    }
    if (always_) return true;
    if (left_-- > 0) return false;
    draw();
    return true;
  }

 private:
  void draw() noexcept;

  Random random_;
  double log_spared_;
  bool always_;
  std::int64_t left_ = 0;  // bursts until it acts
  Time every_;
  Time next_;
};

/// A run of `bits` data bits at a random place: its first and last bit are wrong, those between by chance. A run that is
/// longer than the burst covers it.
class BurstErrors final : public FaultHook {
 public:
  BurstErrors(unsigned bits, FaultSide side, std::uint64_t seed) noexcept
      : random_{seed}, bits_{bits}, side_{side} {}
  bool on_burst(Burst& burst) noexcept override;

 private:
  Random random_;
  unsigned bits_;
  FaultSide side_;
};

/// Bit `column` (0 is sent first) of every byte reads `value`.
class StuckColumn final : public FaultHook {
 public:
  StuckColumn(unsigned column, bool value, FaultSide side) noexcept
      : mask_{static_cast<std::uint8_t>(1u << column)}, value_{value}, side_{side} {}
  bool on_burst(Burst& burst) noexcept override;

 private:
  std::uint8_t mask_;
  bool value_;
  FaultSide side_;
};

/// Random characters too many: before each character, and at the end, with one probability. A burst takes no more than
/// it has room for.
class ExtraCharacters final : public FaultHook {
 public:
  ExtraCharacters(double probability, FaultSide side, std::uint64_t seed) noexcept
      : random_{seed}, probability_{probability}, side_{side} {}
  bool on_burst(Burst& burst) noexcept override;

 private:
  Random random_;
  double probability_;
  FaultSide side_;
};

/// Whole requests that the encoder does not hear; its own account of T1 does not see them either.
class LostRequests final : public FaultHook {
 public:
  LostRequests(double probability, std::uint64_t seed) noexcept : random_{seed}, probability_{probability} {}
  bool on_burst(Burst& burst) noexcept override;

 private:
  Random random_;
  double probability_;
};

/// The CF of a reply is that of another data ID, and the CRC is right for it.
class WrongCf final : public FaultHook {
 public:
  explicit WrongCf(std::uint64_t seed) noexcept : random_{seed} {}
  bool on_burst(Burst& burst) noexcept override;

 private:
  Random random_;
};

/// The reply starts `gap` after the last stop bit of the request before it.
class OtherT2 final : public FaultHook {
 public:
  OtherT2(Time gap, Time character_time) noexcept : gap_{gap}, character_{character_time} {}
  bool on_burst(Burst& burst) noexcept override;
  /// Requests that it does not act on still have an end.
  void note_request(const Burst& burst) noexcept;

 private:
  Time gap_;
  Time character_;
  Time request_end_ = kNever;
};

/// The host's driver leaves the line later. What is sent stays as it is, so the request remains evidence of T1.
class LateRelease final : public FaultHook {
 public:
  explicit LateRelease(Time by) noexcept : by_{by} {}
  bool on_burst(Burst& burst) noexcept override;

 private:
  Time by_;
};

/// A reply breaks off after a random character, and its rest comes later, as a burst of its own.
class BrokenReply final : public FaultHook {
 public:
  BrokenReply(Time pause, Time character_time, std::uint64_t seed) noexcept
      : random_{seed}, pause_{pause}, character_{character_time} {}
  bool on_burst(Burst& burst) noexcept override;
  [[nodiscard]] Time next_own() const noexcept override { return rest_.count == 0 ? kNever : rest_.start; }
  bool on_own(Burst& burst) noexcept override;

 private:
  Random random_;
  Time pause_;
  Time character_;
  Burst rest_{};
};

/// Somebody else on the line: random characters, one burst after the other.
class OtherTalker final : public FaultHook {
 public:
  /// `characters` 1..32 a burst, with pauses of `pause` on average; 0: none at all. It begins at `from` and speaks until
  /// `until`.
  OtherTalker(unsigned characters, Time pause, Time character_time, Time from, Time until,
              std::uint64_t seed) noexcept;
  bool on_burst(Burst&) noexcept override { return false; }
  [[nodiscard]] Time next_own() const noexcept override { return next_; }
  bool on_own(Burst& burst) noexcept override;

 private:
  void plan_next(Time end) noexcept;

  Random random_;
  unsigned characters_;
  Time pause_;
  Time character_;
  Time until_;
  Time next_;
};

}  // namespace tm485::sim
