// EepromTasks: what a campaign has in the background: pieces of the EEPROM are read, or written, between the cycles, one
// after the other, and held against the model's bytes. Specification: section 5.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "campaign/dice.hpp"
#include "campaign/judge.hpp"
#include "tm485/bus/bus.hpp"
#include "tm485/bus/eeprom.hpp"
#include "tm485/sim/simulated_encoder.hpp"

namespace tm485::cli::campaign {

/// One owner. After the constructor nothing allocates. The discipline is the stack's; the tests leave parts of it out.
template <class Discipline>
class EepromTasks {
 public:
  /// Gives every byte of the model's EEPROM a value that its neighbours, and those of other pages, do not have.
  EepromTasks(const CompiledProfile& profile, sim::SimulatedEncoder& encoder, std::uint64_t seed,
              bool writes) noexcept
      : profile_(&profile), encoder_(&encoder), dice_(seed), writes_(writes) {
    auto& eeprom = encoder.model().eeprom();
    const std::span<std::uint8_t> bytes = std::span(image_).first(eeprom.image().size());
    for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(dice_.seed());
    (void)eeprom.set_image(bytes);
  }

  /// After each poll. Answers when to poll and call again at the latest.
  template <class B>
  [[nodiscard]] Time drive(B& bus, Judge& judge, Time now) noexcept {
    if (manager_ && !manager_->active()) {
      ok_ = judge.on_eeprom(outcome(), now);
      manager_.reset();
      // Between writes the cycle has its turn.
      if (writing_) next_ = now + dice_.span(Time{0}, std::chrono::milliseconds(20));
    }
    if (!manager_) {
      if (now < next_) return next_;
      begin(now);
    }
    return tm485::drive(*manager_, bus, now);
  }
  /// False: the judge has found a rule broken.
  [[nodiscard]] bool ok() const noexcept { return ok_; }

 private:
  static constexpr std::size_t kMostBytes = std::size_t{7} * 127;
  static constexpr std::size_t kMostAtOnce = 24;
  static constexpr std::size_t kMostWritten = 4;

  /// Each piece by a manager of its own, which knows nothing of the page that the one before has selected.
  void begin(Time now) noexcept {
    manager_.emplace(*profile_);
    writing_ = writes_ && !dice_.once_in(3);
    const auto count = static_cast<std::size_t>(1 + dice_.below(writing_ ? kMostWritten : kMostAtOnce));
    first_ = static_cast<unsigned>(dice_.below(static_cast<std::int64_t>(manager_->size() - count)));
    piece_ = std::span(buffer_).first(count);
    begun_ = now;
    const auto image = encoder_->model().eeprom().image();
    std::copy(image.begin(), image.end(), image_.begin());
    if (!writing_) {
      (void)manager_->start_read(first_, piece_);
      return;
    }
    for (std::uint8_t& byte : piece_) byte = static_cast<std::uint8_t>(dice_.seed());
    (void)manager_->start_write(first_, piece_);
  }

  [[nodiscard]] EepromOutcome outcome() const noexcept {
    EepromOutcome outcome{.begun = begun_, .result = manager_->outcome()->code, .wrote = writing_};
    const auto image = encoder_->model().eeprom().image();
    for (std::size_t k = 0; k < piece_.size(); ++k)
      outcome.different += piece_[k] != image[first_ + k] ? 1 : 0;
    for (std::size_t k = 0; k < image.size(); ++k) {
      const bool inside = writing_ && k >= first_ && k < first_ + piece_.size();
      outcome.elsewhere += !inside && image[k] != image_[k] ? 1 : 0;
    }
    return outcome;
  }

  const CompiledProfile* profile_;
  sim::SimulatedEncoder* encoder_;
  Dice dice_;
  bool writes_;
  bool writing_ = false;
  std::optional<BasicEepromManager<Discipline>> manager_;
  std::array<std::uint8_t, kMostBytes> image_{};  // as it was before the task
  std::array<std::uint8_t, kMostAtOnce> buffer_{};
  std::span<std::uint8_t> piece_;
  unsigned first_ = 0;
  Time begun_{0};
  Time next_{0};
  bool ok_ = true;
};

}  // namespace tm485::cli::campaign
