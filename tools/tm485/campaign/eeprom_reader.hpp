// EepromReader: what a campaign has in the background: it reads pieces of the EEPROM between the cycles, one after the
// other, and holds each against the model's bytes. Specification: section 5.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "campaign/judge.hpp"
#include "tm485/bus/bus.hpp"
#include "tm485/bus/eeprom.hpp"
#include "tm485/sim/random.hpp"
#include "tm485/sim/simulated_encoder.hpp"

namespace tm485::cli::campaign {

/// One owner. After the constructor nothing allocates. The discipline is the stack's; the tests leave parts of it out.
template <class Discipline>
class EepromReader {
 public:
  /// Gives every byte of the model's EEPROM a value that its neighbours, and those of other pages, do not have.
  EepromReader(const CompiledProfile& profile, sim::SimulatedEncoder& encoder, std::uint64_t seed) noexcept
      : profile_(&profile), encoder_(&encoder), random_{seed} {
    auto& eeprom = encoder.model().eeprom();
    std::array<std::uint8_t, kMostBytes> image{};
    const std::span<std::uint8_t> bytes = std::span(image).first(eeprom.image().size());
    for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random_.next());
    (void)eeprom.set_image(bytes);
  }

  /// After each poll. Answers when to poll and call again at the latest.
  template <class B>
  [[nodiscard]] Time drive(B& bus, Judge& judge, Time now) noexcept {
    if (!manager_ || !manager_->active()) {
      if (manager_) ok_ = judge.on_eeprom(outcome(), now);
      begin(now);
    }
    return tm485::drive(*manager_, bus, now);
  }
  /// False: the judge has found a rule broken.
  [[nodiscard]] bool ok() const noexcept { return ok_; }

 private:
  static constexpr std::size_t kMostBytes = std::size_t{7} * 127;
  static constexpr std::size_t kMostAtOnce = 24;

  /// Each piece by a manager of its own, which knows nothing of the page that the one before has selected.
  void begin(Time now) noexcept {
    manager_.emplace(*profile_);
    const auto count = static_cast<std::size_t>(1 + random_.below(kMostAtOnce));
    first_ = static_cast<unsigned>(random_.below(static_cast<std::int64_t>(manager_->size() - count)));
    read_ = std::span(buffer_).first(count);
    begun_ = now;
    (void)manager_->start_read(first_, read_);
  }

  [[nodiscard]] EepromOutcome outcome() const noexcept {
    EepromOutcome outcome{.begun = begun_, .result = manager_->outcome()->code, .different = 0};
    const auto image = encoder_->model().eeprom().image().subspan(first_);
    for (std::size_t k = 0; k < read_.size(); ++k) outcome.different += read_[k] != image[k] ? 1 : 0;
    return outcome;
  }

  const CompiledProfile* profile_;
  sim::SimulatedEncoder* encoder_;
  sim::Random random_;
  std::optional<BasicEepromManager<Discipline>> manager_;
  std::array<std::uint8_t, kMostAtOnce> buffer_{};
  std::span<std::uint8_t> read_;
  unsigned first_ = 0;
  Time begun_{0};
  bool ok_ = true;
};

}  // namespace tm485::cli::campaign
