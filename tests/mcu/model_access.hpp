// A model of a UART as the register access of a driver.
#pragma once

#include <cstddef>
#include <cstdint>

namespace tm485::test {

/// While one lives a model is at work, which is hardware: no interrupt comes in the middle of it.
class ModelAtWork {
 public:
  ModelAtWork() noexcept : before_(at_work) { at_work = true; }
  ModelAtWork(const ModelAtWork&) = delete;
  ModelAtWork& operator=(const ModelAtWork&) = delete;
  ~ModelAtWork() { at_work = before_; }

  [[nodiscard]] static bool any() noexcept { return at_work; }

 private:
  static inline volatile bool at_work = false;
  bool before_;
};

/// Refers to `M`, which must outlive it.
template <class M>
class ModelAccess {
 public:
  explicit ModelAccess(M& model) noexcept : model_(&model) {}

  std::uint8_t read8(std::size_t offset) noexcept {
    const ModelAtWork at_work;
    return model_->read8(offset);
  }
  std::uint16_t read16(std::size_t offset) noexcept {
    const ModelAtWork at_work;
    return model_->read16(offset);
  }
  std::uint32_t read32(std::size_t offset) noexcept {
    const ModelAtWork at_work;
    return model_->read32(offset);
  }
  void write8(std::size_t offset, std::uint8_t value) noexcept {
    const ModelAtWork at_work;
    model_->write8(offset, value);
  }
  void write16(std::size_t offset, std::uint16_t value) noexcept {
    const ModelAtWork at_work;
    model_->write16(offset, value);
  }
  void write32(std::size_t offset, std::uint32_t value) noexcept {
    const ModelAtWork at_work;
    model_->write32(offset, value);
  }

 private:
  M* model_;
};

/// The driver pin of a model, switched by a GPIO.
template <class M>
class ModelDriverPin {
 public:
  explicit ModelDriverPin(M& model) noexcept : model_(&model) {}

  bool operator()(bool on) noexcept {
    const ModelAtWork at_work;
    model_->engine().set_driver(on);
    return !broken;
  }
  bool broken = false;

 private:
  M* model_;
};

}  // namespace tm485::test
