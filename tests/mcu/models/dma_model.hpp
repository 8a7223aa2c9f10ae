// Two DMA channels at a UART's model: they move a byte when the UART asks for it, in character time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace tm485::test {

/// Memory to the UART, once.
struct SendChannelModel {
  std::span<const std::uint8_t> bytes;
  std::size_t moved = 0;
  bool on = false;
  std::uint32_t starts = 0;
};

/// The UART to memory, round and round.
struct ReceiveChannelModel {
  std::span<std::uint8_t> ring;
  std::size_t next = 0;
  bool on = false;
};

/// The register access of a driver, so to speak: what a port under test has of a channel.
class SendChannel {
 public:
  explicit SendChannel(SendChannelModel& model) noexcept : model_(&model) {}
  void start(std::span<const std::uint8_t> bytes) noexcept {
    *model_ = {.bytes = bytes, .moved = 0, .on = true, .starts = model_->starts + 1};
  }
  [[nodiscard]] std::size_t remaining() noexcept { return model_->bytes.size() - model_->moved; }
  [[nodiscard]] bool complete() noexcept { return remaining() == 0; }
  [[nodiscard]] bool failed() noexcept { return false; }
  void stop() noexcept { model_->on = false; }

 private:
  SendChannelModel* model_;
};

class ReceiveChannel {
 public:
  explicit ReceiveChannel(ReceiveChannelModel& model) noexcept : model_(&model) {}
  void start(std::span<std::uint8_t> ring) noexcept { *model_ = {.ring = ring, .next = 0, .on = true}; }
  [[nodiscard]] std::size_t remaining() noexcept { return model_->ring.size() - model_->next; }
  [[nodiscard]] bool failed() noexcept { return false; }
  void stop() noexcept { model_->on = false; }

 private:
  ReceiveChannelModel* model_;
};

}  // namespace tm485::test
