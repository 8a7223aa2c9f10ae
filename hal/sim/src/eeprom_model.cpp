#include "tm485/sim/eeprom_model.hpp"

#include <algorithm>
#include <cassert>

namespace tm485::sim {
namespace {

constexpr std::uint8_t kErased = 0xFF;
constexpr Time kPageTime = std::chrono::milliseconds{18};
constexpr std::int64_t kByteValues = 256;

}  // namespace

EepromModel::EepromModel(const EepromConfig& config) noexcept
    : config_{config}, random_{config.seed}, page_{config.power_up_page}, page_before_{config.power_up_page} {
  assert(config.pages >= 1 && config.pages <= kPages);
  assert(config.write_time_min <= config.write_time_max);
  image_.fill(kErased);
  on_power_up();
}

bool EepromModel::write(std::uint8_t address, std::uint8_t value, Time start) noexcept {
  if (start < next_allowed_) ++interval_violations_;
  if (busy(start)) return false;

  if (address >= kPageRegister) {
    page_before_ = page_;
    page_ = value;
    written_ = kNone;
    ++page_selects_;
    busy_until_ = start + config_.page_time.value_or(kPageTime);
    next_allowed_ = start + config_.page_interval;
    return true;
  }
  next_allowed_ = start + config_.write_interval;
  if (page_ >= config_.pages) return true;
  store(index(page_, address), value);
  busy_until_ = start + draw_write_time();
  return true;
}

void EepromModel::store(std::size_t at, std::uint8_t value) noexcept {
  ++writes_[at];
  ++all_writes_;
  ++generation_;
  written_ = at;
  byte_before_ = image_[at];
  page_before_ = page_;
  if (config_.failed_writes > 0.0 && random_.unit() <= config_.failed_writes) {
    ++failed_writes_;
    return;
  }
  image_[at] = value;
}

Time EepromModel::draw_write_time() noexcept {
  const std::int64_t choices = (config_.write_time_max - config_.write_time_min).count() + 1;
  return config_.write_time_min + Time{choices > 1 ? random_.below(choices) : 0};
}

void EepromModel::on_power_off(Time at) noexcept {
  if (!busy(at)) return;
  if (written_ != kNone) {
    image_[written_] = static_cast<std::uint8_t>(random_.below(kByteValues));
    ++spoiled_bytes_;
    written_ = kNone;
  } else if (random_.below(2) == 0) {
    page_ = page_before_;
  }
  busy_until_ = -kNever;
}

void EepromModel::on_power_up() noexcept {
  if (config_.page_volatile) page_ = config_.power_up_page;
  busy_until_ = config_.busy_at_start > Time{0} ? config_.busy_at_start : -kNever;
  next_allowed_ = -kNever;
}

bool EepromModel::set_image(std::span<const std::uint8_t> bytes) noexcept {
  if (bytes.size() != image().size()) return false;
  std::ranges::copy(bytes, image_.begin());
  written_ = kNone;
  ++generation_;
  return true;
}

EepromModel::Image EepromModel::settled_image(Time now) const noexcept {
  Image settled = image_;
  if (written_ != kNone && busy(now)) settled[written_] = byte_before_;
  return settled;
}

}  // namespace tm485::sim
