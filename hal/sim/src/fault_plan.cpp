#include "tm485/sim/fault_plan.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "option_text.hpp"

namespace tm485::sim {
namespace {

constexpr double kPpm = 1e-6;
constexpr double kPercent = 1e-2;
constexpr std::size_t kMostOfAWord = 64;  // a message repeats no more of a word

std::string shortened(std::string_view word) {
  if (word.size() <= kMostOfAWord) return std::string(word);
  return std::string(word.substr(0, kMostOfAWord)) + "...";
}

std::string_view what_is_written(FaultUnit unit) {
  constexpr std::array<std::string_view, 8> kForms{
      "a probability 0..1 such as 1e-4",    "a whole number",
      "one byte in hexadecimal such as 04", "a time such as 30us",
      "ppm or %, such as 300ppm or 2%",     "ppm/s or %/s, such as +300ppm/s",
      "requests, replies or both",          "pair or receive"};
  return kForms[static_cast<std::size_t>(unit)];
}

std::optional<double> read_ratio(std::string_view text) {
  double unit = 0.0;
  if (text.ends_with("ppm")) {
    unit = kPpm;
    text.remove_suffix(3);
  } else if (text.ends_with('%')) {
    unit = kPercent;
    text.remove_suffix(1);
  } else {
    return std::nullopt;
  }
  if (text.starts_with('+')) text.remove_prefix(1);
  const auto value = number(text, -1e9, 1e9);
  return value ? std::optional{*value * unit} : std::nullopt;
}

std::optional<double> read_word(std::string_view text, std::span<const std::string_view> words) {
  const auto found = std::ranges::find(words, text);
  if (found == words.end()) return std::nullopt;
  return static_cast<double>(found - words.begin());
}

constexpr std::array<std::string_view, 3> kDirections{"requests", "replies", "both"};
constexpr std::array<std::string_view, 2> kPairs{"pair", "receive"};

std::optional<double> read_unit(std::string_view text, FaultUnit unit) {
  switch (unit) {
    case FaultUnit::probability:
      return number(text, 0.0, 1.0);
    case FaultUnit::count:
      if (const auto whole = integer<std::uint16_t>(text)) return *whole;
      return std::nullopt;
    case FaultUnit::byte:
      if (const auto byte = integer<std::uint8_t>(text, 16)) return *byte;
      return std::nullopt;
    case FaultUnit::time:
      if (const auto time = time_span(text, FaultPlan::kLatest)) return static_cast<double>(time->count());
      return std::nullopt;
    case FaultUnit::ratio:
      return read_ratio(text);
    case FaultUnit::ratio_rate:
      if (!text.ends_with("/s")) return std::nullopt;
      return read_ratio(text.substr(0, text.size() - 2));
    case FaultUnit::direction:
      return read_word(text, kDirections);
    case FaultUnit::pair:
      return read_word(text, kPairs);
  }
  return std::nullopt;
}

std::string shortest(double value) {
  std::array<char, 32> buffer{};
  const auto [end, error] = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return error == std::errc{} ? std::string(buffer.data(), end) : "0";
}

std::string time_text(Time time) {
  struct Unit {
    std::int64_t ns;
    std::string_view suffix;
  };
  constexpr std::array<Unit, 3> kUnits{{{1'000'000'000, "s"}, {1'000'000, "ms"}, {1'000, "us"}}};
  for (const Unit& unit : kUnits)
    if (time.count() % unit.ns == 0) return std::to_string(time.count() / unit.ns) + std::string(unit.suffix);
  return std::to_string(time.count()) + "ns";
}

/// Millionths, or percents, that read back as the same number. What was read as one of them need not be a number of the other:
/// multiplying rounds, and the quotient is beside what was written.
std::string ratio_text(double value) {
  struct Unit {
    double size;
    std::string_view suffix;
  };
  constexpr std::array<Unit, 2> kUnits{{{kPpm, "ppm"}, {kPercent, "%"}}};
  for (const Unit& unit : kUnits)
    if (const double whole = std::round(value / unit.size); whole * unit.size == value)
      return shortest(whole) + std::string(unit.suffix);
  constexpr int kBeside = 2;
  for (const Unit& unit : kUnits) {
    double tried = value / unit.size;
    for (int k = 0; k < kBeside; ++k) tried = std::nextafter(tried, -HUGE_VAL);
    for (int k = -kBeside; k <= kBeside; ++k) {
      if (tried * unit.size == value) return shortest(tried) + std::string(unit.suffix);
      tried = std::nextafter(tried, HUGE_VAL);
    }
  }
  return shortest(value / kPpm) + "ppm";
}

std::string value_text(double value, FaultUnit unit) {
  switch (unit) {
    case FaultUnit::time:
      return time_text(Time{std::llround(value)});
    case FaultUnit::ratio:
      return ratio_text(value);
    case FaultUnit::ratio_rate:
      return ratio_text(value) + "/s";
    case FaultUnit::direction:
      return std::string(kDirections[static_cast<std::size_t>(value)]);
    case FaultUnit::pair:
      return std::string(kPairs[static_cast<std::size_t>(value)]);
    case FaultUnit::byte: {
      constexpr std::string_view kDigits = "0123456789ABCDEF";
      const auto byte = static_cast<unsigned>(value);
      return {kDigits[byte / 16], kDigits[byte % 16]};
    }
    case FaultUnit::probability:
    case FaultUnit::count:
      break;
  }
  return shortest(value);
}

/// Reads one line. Words are separated by blanks.
class LineParser {
 public:
  LineParser(std::string_view text, std::size_t place) : text_(text), place_(place) {}

  std::expected<FaultLine, PlanError> read() {
    const std::string_view name = next_word();
    const auto kinds = fault_kinds();
    const auto found = std::ranges::find(kinds, name, &FaultInfo::name);
    if (found == kinds.end()) {
      std::string known = "known are:";
      for (const FaultInfo& info : kinds) known += " " + std::string(info.name);
      return error("plan_unknown_fault", "no fault is called '" + shortened(name) + "'", known);
    }
    info_ = &*found;
    line_.kind = info_->kind;
    for (std::size_t k = 0; k < info_->parameters.size(); ++k)
      line_.values[k] = info_->parameters[k].otherwise;
    for (std::string_view word = next_word(); !word.empty(); word = next_word()) {
      if (auto problem = take(word)) return std::unexpected(std::move(*problem));
    }
    return finish();
  }

 private:
  using Problem = std::optional<PlanError>;

  std::string_view next_word() {
    const std::size_t begin = std::min(text_.find_first_not_of(" \t\r"), text_.size());
    text_.remove_prefix(begin);
    const std::string_view word = text_.substr(0, text_.find_first_of(" \t\r"));
    text_.remove_prefix(word.size());
    return word;
  }

  std::unexpected<PlanError> error(std::string_view name, std::string cause, std::string remedy) const {
    return std::unexpected(PlanError{name, place_, std::move(cause), std::move(remedy)});
  }
  PlanError bad_value(std::string_view word, std::string_view expected) const {
    return {"plan_bad_value", place_, "'" + shortened(word) + "' is not possible",
            "write " + std::string(expected)};
  }

  Problem take(std::string_view word) {
    const std::size_t equals = word.find('=');
    if (equals == std::string_view::npos) {
      if (info_->bare_value && !given_[0]) return parameter(0, word, word);
      return PlanError{"plan_unknown_key", place_, "'" + shortened(word) + "' has no meaning here",
                       "write key=value; " + keys()};
    }
    const std::string_view key = word.substr(0, equals);
    const std::string_view value = word.substr(equals + 1);
    for (std::size_t k = 0; k < info_->parameters.size(); ++k)
      if (!key.empty() && info_->parameters[k].name == key) return parameter(k, value, word);
    return when(key, value, word);
  }

  Problem parameter(std::size_t k, std::string_view value, std::string_view word) {
    const FaultParameter& row = info_->parameters[k];
    if (given_[k])
      return PlanError{"plan_unknown_key", place_, std::string(row.name) + " is given twice",
                       "leave one of them"};
    given_[k] = true;
    const auto read = read_unit(value, row.unit);
    if (!read || *read < row.low || *read > row.high) {
      std::string expected(what_is_written(row.unit));
      if (row.unit != FaultUnit::probability && row.unit != FaultUnit::direction &&
          row.unit != FaultUnit::pair)
        expected += ", " + value_text(row.low, row.unit) + " to " + value_text(row.high, row.unit);
      return bad_value(word, expected);
    }
    line_.values[k] = *read;
    return std::nullopt;
  }

  /// When it acts.
  Problem when(std::string_view key, std::string_view value, std::string_view word) {
    if (key == "from" || key == "at") return instant(line_.from, value, word);
    if (key == "until") return instant(line_.until, value, word);
    if (key == "for") {
      const auto span = time_span(value, FaultPlan::kLatest);
      if (!span || *span == Time{0}) return bad_value(word, "a time above 0 such as 20ms");
      span_ = *span;
      return std::nullopt;
    }
    if (key == "cycles") return cycles(value, word);
    if (key == "p" && info_->by_chance) {
      const auto chance = number(value, 0.0, 1.0);
      if (!chance) return bad_value(word, "a probability 0..1 such as 1e-3");
      line_.probability = *chance;
      return std::nullopt;
    }
    if (key == "every" && info_->by_chance) {
      const auto span = time_span(value, FaultPlan::kLatest);
      if (!span || *span == Time{0}) return bad_value(word, "a time above 0 such as 10ms");
      line_.every = *span;
      return std::nullopt;
    }
    if (key == "seed") {
      line_.seed = integer<std::uint64_t>(value);
      return line_.seed ? std::nullopt : Problem{bad_value(word, "a whole number from 0")};
    }
    return PlanError{"plan_unknown_key", place_,
                     std::string(info_->name) + " takes no '" + shortened(key) + "'", keys()};
  }

  Problem instant(Time& to, std::string_view value, std::string_view word) const {
    const auto time = time_span(value, FaultPlan::kLatest);
    if (!time) return bad_value(word, "a time to 1000 hours such as 1.5s");
    to = *time;
    return std::nullopt;
  }
  /// A..B, A.. or A
  Problem cycles(std::string_view value, std::string_view word) {
    const std::size_t dots = value.find("..");
    const auto first = integer<std::uint64_t>(value.substr(0, dots));
    const std::string_view rest =
        dots == std::string_view::npos ? std::string_view{} : value.substr(dots + 2);
    const auto last = rest.empty() ? std::nullopt : integer<std::uint64_t>(rest);
    if (!first || (!rest.empty() && !last)) return bad_value(word, "two whole numbers such as 1000..1020");
    line_.first_cycle = *first;
    line_.last_cycle = dots == std::string_view::npos ? *first : last.value_or(FaultLine::kEveryCycle);
    return std::nullopt;
  }

  [[nodiscard]] std::string keys() const {
    std::string text = "keys of " + std::string(info_->name) + ":";
    for (const FaultParameter& row : info_->parameters)
      if (!row.name.empty()) text += " " + std::string(row.name);
    return text + (info_->by_chance ? " p every" : "") + " from at until for cycles seed";
  }

  std::expected<FaultLine, PlanError> finish() {
    for (std::size_t k = 0; k < info_->parameters.size(); ++k) {
      const FaultParameter& row = info_->parameters[k];
      if (row.required && !given_[k])
        return error("plan_missing_value", std::string(info_->name) + " needs " + std::string(row.name),
                     "add " + std::string(row.name) + "= with " + std::string(what_is_written(row.unit)));
    }
    if (span_) {
      if (line_.until != kNever)
        return error("plan_bad_window", "both until= and for= are given", "leave one of them");
      line_.until = line_.from + *span_;
    }
    if (line_.until <= line_.from || line_.last_cycle < line_.first_cycle)
      return error("plan_bad_window", "it ends before it begins", "give an end behind the beginning");
    return line_;
  }

  std::string_view text_;
  std::size_t place_;
  const FaultInfo* info_ = nullptr;
  FaultLine line_;
  std::array<bool, FaultInfo::kParameters> given_{};
  std::optional<Time> span_;
};

PlanError too_large(std::string cause) {
  return {"plan_too_large", 0, std::move(cause), "at most 64 lines and 16 KiB: make a shorter plan"};
}

}  // namespace

std::string PlanError::text() const {
  std::string place = line == 0 ? "" : "line " + std::to_string(line) + ": ";
  return place + cause + "; " + remedy;
}

std::expected<FaultPlan, PlanError> FaultPlan::parse(std::string_view text) {
  if (text.size() > kMostBytes) return std::unexpected(too_large("the plan has more than 16 KiB"));
  FaultPlan plan;
  for (std::size_t place = 1; !text.empty(); ++place) {
    const std::string_view whole = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(whole.size() + 1, text.size()));
    for (const std::string_view part : split(whole.substr(0, whole.find('#')), ';')) {
      if (part.find_first_not_of(" \t\r") == std::string_view::npos) continue;
      const auto line = LineParser(part, place).read();
      if (!line) return std::unexpected(line.error());
      if (!plan.add(*line)) return std::unexpected(too_large("the plan has more than 64 faults"));
    }
  }
  return plan;
}

std::string FaultPlan::to_text(const FaultLine& line) {
  const FaultInfo& info = info_of(line.kind);
  std::string text(info.name);
  const auto add = [&](std::string_view key, const std::string& value) {
    text += ' ';
    text += key;
    text += '=';
    text += value;
  };
  for (std::size_t k = 0; k < info.parameters.size(); ++k) {
    const FaultParameter& row = info.parameters[k];
    if (!row.name.empty() && (row.required || line.values[k] != row.otherwise))
      add(row.name, value_text(line.values[k], row.unit));
  }
  if (line.probability < 1.0) add("p", shortest(line.probability));
  if (line.every > Time{0}) add("every", time_text(line.every));
  if (line.from > Time{0}) add("from", time_text(line.from));
  if (line.until != kNever) add("until", time_text(line.until));
  if (line.first_cycle != 0 || line.last_cycle != FaultLine::kEveryCycle) {
    const bool open = line.last_cycle == FaultLine::kEveryCycle;
    add("cycles", std::to_string(line.first_cycle) + ".." + (open ? "" : std::to_string(line.last_cycle)));
  }
  if (line.seed) add("seed", std::to_string(*line.seed));
  return text;
}

std::string FaultPlan::to_text() const {
  std::string text;
  for (const FaultLine& line : lines_) text += to_text(line) + '\n';
  return text;
}

bool FaultPlan::add(const FaultLine& line) {
  if (lines_.size() == kMostLines) return false;
  lines_.push_back(line);
  return true;
}

bool FaultPlan::add(const FaultPlan& other) {
  return std::ranges::all_of(other.lines_, [this](const FaultLine& line) { return add(line); });
}

std::string_view FaultPlan::not_served() const noexcept {
  for (const FaultLine& line : lines_)
    if (!info_of(line.kind).served) return info_of(line.kind).name;
  return {};
}

}  // namespace tm485::sim
