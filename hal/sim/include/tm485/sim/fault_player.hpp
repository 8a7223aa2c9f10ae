// FaultPlayer: a fault plan in action on one line and its encoder.
//
// The line shows it every burst; each fault that acts just then changes it, in the order of the plan. What is a state of
// the line or the encoder (echo, swapped wires, alarms, a frozen sensor) is switched when the first request of its
// window leaves. The same plan with the same seed does the same again.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "tm485/sim/distortion.hpp"
#include "tm485/sim/fault_hook.hpp"
#include "tm485/sim/fault_plan.hpp"
#include "tm485/sim/line_faults.hpp"
#include "tm485/time.hpp"

namespace tm485::sim {

class EncoderModel;
class Line;

/// What the plan has done to the exchange under way, and lately: for whoever judges the host.
struct FaultEffects {
  Time last = -kNever;  ///< until when a fault has had an effect; kNever while one lasts with no known end
  Time last_change = -kNever;    ///< likewise, of one that has changed bits or put some on the line
  Time talker_before = -kNever;  ///< until when somebody else had spoken when this request left
  bool touched = false;          ///< this exchange, in any way
  bool bits_changed = false;     ///< in its request or its reply
  bool mixed = false;  ///< likewise, by another talker, a distortion, the rest of an earlier reply or an echo
  bool frozen = false;     ///< the encoder's sensor stands still
  bool restarted = false;  ///< the effect that `last` speaks of is a restart: the encoder has booted by then
};

/// One owner. After the constructor nothing allocates; a burst costs a few nanoseconds and what the faults need.
class FaultPlayer final : public FaultHook {
 public:
  /// What it plays on. They must outlive it. Without a line (a server) only faults that FaultInfo::served names act.
  struct Stage {
    EncoderModel* encoder = nullptr;
    Line* line = nullptr;
    Distortion* distortion = nullptr;
    Time character_time{4'000};
  };

  FaultPlayer(const FaultPlan& plan, std::uint64_t seed, const Stage& stage);
  ~FaultPlayer() override;
  FaultPlayer(const FaultPlayer&) = delete;
  FaultPlayer& operator=(const FaultPlayer&) = delete;

  bool on_burst(Burst& burst) noexcept override;
  [[nodiscard]] Time next_own() const noexcept override { return next_own_; }
  bool on_own(Burst& burst) noexcept override;

  [[nodiscard]] bool empty() const noexcept { return faults_.empty(); }
  [[nodiscard]] const FaultEffects& effects() const noexcept { return effects_; }
  /// The fault `echo` is on; a line has been told already.
  [[nodiscard]] bool echoes() const noexcept { return echoes_; }
  /// Requests that it has seen.
  [[nodiscard]] std::uint64_t cycles() const noexcept { return cycles_; }
  /// The last reply of the encoder as the line carries it, with everything that was done to it; both parts of one that
  /// paused.
  [[nodiscard]] const Burst& last_reply() const noexcept { return last_reply_; }
  /// Whether each burst of the encoder is kept for last_reply(): it costs a copy.
  void keep_replies(bool keep) noexcept { keep_replies_ = keep; }

  /// Bursts that the fault of this place in the plan has changed, or times that it was switched on.
  [[nodiscard]] std::uint64_t hits(std::size_t place) const noexcept { return faults_[place].hits; }
  [[nodiscard]] std::uint64_t bits_flipped() const noexcept;

 private:
  struct Fault {
    FaultLine line;
    std::unique_ptr<FaultHook> hook;  // null: a state
    std::optional<FaultTrigger> trigger;
    std::uint64_t hits = 0;
    std::uint64_t broke_in = 0;  // the request whose reply it has broken in two
    FaultSide side = FaultSide::both;
    bool triggered = false;
    bool changes_bits = false;
    bool active = false;
    bool speaks = false;
    Time next{0};      // of a restart
    Time on_until{0};  // likewise: until then the one before is not over
  };

  void make_hook(Fault& fault, std::uint64_t seed) const;
  void look_at_windows(Time now) noexcept;
  void switch_state(Fault& fault, bool on, Time now) noexcept;
  void distort(Time now) noexcept;
  void restart_if_due(Fault& fault, Time until) noexcept;
  void touch(Time until, bool bits_changed) noexcept;
  [[nodiscard]] bool apply(Fault& fault, Burst& burst) noexcept;
  void note_states(const Burst& burst) noexcept;
  void find_next_own() noexcept;

  Stage stage_;
  DistortionConfig plain_;  // what the line does without the plan
  bool plain_echo_ = false;
  std::uint8_t plain_sf_ = 0;
  std::uint8_t plain_almc_ = 0;
  std::vector<Fault> faults_;
  std::vector<Fault*> active_;  // in the order of the plan, but `t2` first; room for all
  std::vector<Fault*> restarts_;
  std::vector<Fault*> speakers_;
  Time next_window_{0};  // when one opens or closes, in time and in cycles
  std::uint64_t next_window_cycle_ = 0;
  std::uint64_t cycles_ = 0;
  Time next_own_ = kNever;
  Time next_restart_ = kNever;
  Time restarted_until_ = -kNever;
  Time on_line_until_ = -kNever;  // what faults have put there, or delayed
  Time talker_until_ = -kNever;   // somebody else
  Fault* speaker_ = nullptr;
  bool echoes_ = false;
  bool broken_ = false;    // the burst under way has been broken in two
  bool lasting_ = false;   // a state that touches every exchange
  bool drifting_ = false;  // the encoder's bit rate
  bool keep_replies_ = false;
  FaultEffects effects_;
  Burst last_reply_{};
};

}  // namespace tm485::sim
