// What a UART needs from a DMA controller: a channel that moves bytes to its data register, and one that moves them away
// from it. The channels know the register, the request line and their priority; the chip's clock and its multiplexer are
// the caller's affair.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>

namespace tm485::mcu {

/// Memory to the data register, once. The bytes stay where they are until complete() or stop().
template <class C>
concept SendDma = requires(C& channel, std::span<const std::uint8_t> bytes) {
  /// Moves `bytes`, each as the UART asks for it. A start replaces what was under way.
  { channel.start(bytes) } noexcept -> std::same_as<void>;
  /// How many have not been moved.
  { channel.remaining() } noexcept -> std::same_as<std::size_t>;
  /// All are moved; the last has not left the UART yet.
  { channel.complete() } noexcept -> std::same_as<bool>;
  /// The controller has met a bus error, and has stopped.
  { channel.failed() } noexcept -> std::same_as<bool>;
  { channel.stop() } noexcept -> std::same_as<void>;
};

/// The data register to memory, round and round. With a data cache, memory that is not cached.
template <class C>
concept ReceiveDma = requires(C& channel, std::span<std::uint8_t> ring) {
  /// Fills `ring` from its beginning, again and again.
  { channel.start(ring) } noexcept -> std::same_as<void>;
  /// From where the next byte goes to the end of the ring: 1 to its size.
  { channel.remaining() } noexcept -> std::same_as<std::size_t>;
  { channel.failed() } noexcept -> std::same_as<bool>;
  { channel.stop() } noexcept -> std::same_as<void>;
};

}  // namespace tm485::mcu
