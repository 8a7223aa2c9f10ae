// FaultPlan: what goes wrong on a simulated line, as text. One line a fault; several compose in the order of the lines.
//
//   # a noisy line, a cable that comes off for 20 ms, and a restart
//   bits requests=1e-5 replies=1e-4
//   burst bits=8 every=10ms on=replies
//   lose replies=1 from=1s for=20ms
//   restart at=3s off=5ms
//
// A fault is a name, its parameters, and when it acts. The kinds and their parameters are one table
// (fault_kinds), which the parser, the player, the documents and the command share. Failure modes of the line:
// specification, sections 1, 4 and 8.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tm485/time.hpp"

namespace tm485::sim {

enum class FaultKind : std::uint8_t {
  bits,
  burst,
  stuck,
  lose,
  extra,
  late,
  t2,
  wrong_cf,
  overrun,
  late_release,
  noise,
  swapped,
  baud,
  echo,
  talker,
  babble,
  restart,
  alarm,
  frozen,
};
inline constexpr std::size_t kFaultKinds = 19;

/// What a parameter's number means, and so how it is written.
enum class FaultUnit : std::uint8_t {
  probability,  ///< 0..1
  count,        ///< a whole number
  byte,         ///< two hexadecimal digits
  time,         ///< ns, us, ms, s
  ratio,        ///< ppm or %
  ratio_rate,   ///< the same per second: ppm/s, %/s
  direction,    ///< requests, replies, both
  pair,         ///< pair, receive
};

struct FaultParameter {
  std::string_view name;  ///< empty: the row has no more
  FaultUnit unit = FaultUnit::probability;
  double low = 0.0;   ///< smallest value, in the base unit (1, ns)
  double high = 1.0;  ///< largest
  double otherwise = 0.0;
  bool required = false;
};

/// One kind of fault: a row of the table.
struct FaultInfo {
  static constexpr std::size_t kParameters = 3;

  FaultKind kind;
  std::string_view name;
  std::array<FaultParameter, kParameters> parameters;
  bool by_chance;     ///< takes p= and every=: it acts on single bursts
  bool bare_value;    ///< the first parameter may stand without its name
  bool served;        ///< has a meaning for `Server`, which has no line
  bool changes_bits;  ///< what is heard is not what was sent
  std::string_view meaning;
};

/// Every kind, in the order of FaultKind.
[[nodiscard]] std::span<const FaultInfo, kFaultKinds> fault_kinds() noexcept;
[[nodiscard]] const FaultInfo& info_of(FaultKind kind) noexcept;

/// One fault of a plan. Times are those of the line; a cycle is a request on it, counted from 0.
struct FaultLine {
  static constexpr std::uint64_t kEveryCycle = UINT64_MAX;

  FaultKind kind = FaultKind::bits;
  std::array<double, FaultInfo::kParameters> values{};  ///< by the row's parameters, in base units
  Time from{0};
  Time until = kNever;  ///< from <= time < until
  std::uint64_t first_cycle = 0;
  std::uint64_t last_cycle = kEveryCycle;
  double probability = 1.0;           ///< of acting on one burst
  Time every{0};                      ///< acts once in this span; 0: on each
  std::optional<std::uint64_t> seed;  ///< instead of one from the plan's seed and the line's place

  bool operator==(const FaultLine&) const = default;
};

/// Why a text is no plan. `name` is one of: plan_too_large, plan_unknown_fault, plan_unknown_key, plan_bad_value,
/// plan_missing_value, plan_bad_window.
struct PlanError {
  std::string_view name;
  std::size_t line = 0;  ///< from 1; 0: the whole text
  std::string cause;
  std::string remedy;

  /// All of it on one line.
  [[nodiscard]] std::string text() const;
};

/// A value; set-up only, allocates.
class FaultPlan {
 public:
  static constexpr std::size_t kMostLines = 64;
  static constexpr std::size_t kMostBytes = 16'384;
  /// The latest instant that a plan can name.
  static constexpr Time kLatest = std::chrono::hours(1'000);

  FaultPlan() = default;

  /// Lines end with a line end or ';'. '#' begins a comment. The text may come from anywhere: whatever is not a plan is
  /// refused, and size and number are bounded.
  [[nodiscard]] static std::expected<FaultPlan, PlanError> parse(std::string_view text);

  /// One line a fault; parse() makes the same plan of it.
  [[nodiscard]] std::string to_text() const;
  [[nodiscard]] static std::string to_text(const FaultLine& line);

  /// False if there are kMostLines already.
  bool add(const FaultLine& line);
  /// All lines of another plan, behind these; false if they are too many.
  bool add(const FaultPlan& other);

  [[nodiscard]] const std::vector<FaultLine>& lines() const noexcept { return lines_; }
  [[nodiscard]] bool empty() const noexcept { return lines_.empty(); }

  /// The first fault that has no meaning for a server, by name; empty: all have one.
  [[nodiscard]] std::string_view not_served() const noexcept;

  bool operator==(const FaultPlan&) const = default;

 private:
  std::vector<FaultLine> lines_;
};

}  // namespace tm485::sim
