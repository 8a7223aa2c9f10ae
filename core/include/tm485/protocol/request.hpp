// Requests: what the host sends. Specification: sections 2 and 5.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>

#include "tm485/errc.hpp"
#include "tm485/protocol/control_field.hpp"
#include "tm485/protocol/crc.hpp"
#include "tm485/protocol/layout.hpp"

namespace tm485 {

/// EEPROM addresses run from 0 to 127; 127 is the page register.
inline constexpr std::uint8_t kPageRegister = 127;

/// The bytes of one request, 1 to 4. Always well formed: the factories refuse anything else.
/// Any thread or interrupt; constant time; no error but those named.
class Request {
 public:
  /// A request that is its CF alone: every ID but the two of the EEPROM, or bad_argument.
  [[nodiscard]] static constexpr std::expected<Request, Errc> make(DataId id) noexcept {
    if (layout(id).request_length != 1) return std::unexpected(Errc::bad_argument);
    return Request(id);
  }

  /// IDD: read one byte at `address` (0..127) of the page that the encoder has selected, or bad_argument.
  [[nodiscard]] static constexpr std::expected<Request, Errc> eeprom_read(unsigned address) noexcept {
    if (address > 0x7F) return std::unexpected(Errc::bad_argument);
    Request request(DataId::eeprom_read);
    request.bytes_[1] = static_cast<std::uint8_t>(address);
    request.seal();
    return request;
  }

  /// ID6: write `data` to `address` (0..127; 127 selects a page), or bad_argument.
  [[nodiscard]] static constexpr std::expected<Request, Errc> eeprom_write(unsigned address,
                                                                           std::uint8_t data) noexcept {
    if (address > 0x7F) return std::unexpected(Errc::bad_argument);
    Request request(DataId::eeprom_write);
    request.bytes_[1] = static_cast<std::uint8_t>(address);
    request.bytes_[2] = data;
    request.seal();
    return request;
  }

  /// Reads a request off a line: length_error, a CF error, crc_error, or bad_argument for an EEPROM
  /// request with ADF bit 7 (busy exists in replies only).
  [[nodiscard]] static constexpr std::expected<Request, Errc> parse(
      std::span<const std::uint8_t> bytes) noexcept {
    if (bytes.empty()) return std::unexpected(Errc::length_error);
    const auto id = parse_control_field(bytes[0]);
    if (!id) return std::unexpected(id.error());
    if (bytes.size() != layout(*id).request_length) return std::unexpected(Errc::length_error);
    if (bytes.size() > 1 && crc(bytes) != 0) return std::unexpected(Errc::crc_error);
    if (bytes.size() > 1 && (bytes[1] & 0x80U) != 0) return std::unexpected(Errc::bad_argument);
    Request request(*id);
    std::copy(bytes.begin(), bytes.end(), request.bytes_.begin());
    return request;
  }

  [[nodiscard]] constexpr DataId id() const noexcept { return id_; }
  [[nodiscard]] constexpr std::span<const std::uint8_t> bytes() const noexcept {
    return std::span(bytes_).first(layout(id_).request_length);
  }
  /// EEPROM address 0..127; only for the two EEPROM IDs, 0 otherwise.
  [[nodiscard]] constexpr std::uint8_t address() const noexcept { return bytes_[1]; }
  /// The byte to write; only for ID6.
  [[nodiscard]] constexpr std::uint8_t data() const noexcept {
    return id_ == DataId::eeprom_write ? bytes_[2] : std::uint8_t{0};
  }

 private:
  constexpr explicit Request(DataId id) noexcept : bytes_{control_field(id)}, id_(id) {}
  constexpr void seal() noexcept {
    const std::size_t last = layout(id_).request_length - std::size_t{1};
    bytes_[last] = crc(std::span<const std::uint8_t>(bytes_).first(last));
  }

  std::array<std::uint8_t, kMaxRequest> bytes_{};
  DataId id_;
};

}  // namespace tm485
