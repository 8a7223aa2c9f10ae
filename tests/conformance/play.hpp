// What the checks of the port's contract have in common, and their names. Private to tests/conformance.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "conformance/port_conformance.hpp"

namespace tm485::test::conformance {

using Bytes = std::vector<std::uint8_t>;
using State = Transmission::State;

inline constexpr Time kReplyDelay{3'000};
inline constexpr std::array<std::uint8_t, 4> kRequest{0x32, 0x05, 0xA5, 0x92};
inline const Bytes kReply{0x1A, 0x00, 0x39, 0x30, 0x01, 0x11, 0x07, 0x00, 0xFF, 0x80, 0x5E};

inline std::string text(std::span<const std::uint8_t> bytes) {
  static constexpr char kDigits[] = "0123456789ABCDEF";
  std::string line;
  for (const std::uint8_t byte : bytes) {
    if (!line.empty()) line += ' ';
    line += kDigits[byte >> 4U];
    line += kDigits[byte & 15U];
  }
  return line.empty() ? "nothing" : line;
}

inline Bytes bytes_of(const std::vector<HeardByte>& heard) {
  Bytes bytes;
  for (const HeardByte& one : heard) bytes.push_back(one.byte);
  return bytes;
}

inline Bytes first_of(std::span<const std::uint8_t> bytes, std::size_t count) {
  return {bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count)};
}

inline void append(Bytes& to, std::span<const std::uint8_t> from) {
  to.insert(to.end(), from.begin(), from.end());
}

/// A check at work: the rig, and what was found.
class Play {
 public:
  explicit Play(Rig& rig) : rig_(rig) {}

  [[nodiscard]] Rig& rig() { return rig_; }
  void violated(std::string what) { violations_.push_back(std::move(what)); }
  void expect(bool holds, std::string what) {
    if (!holds) violated(std::move(what));
  }
  void expect_same(std::string_view what, std::span<const std::uint8_t> wanted,
                   std::span<const std::uint8_t> got) {
    if (!std::ranges::equal(wanted, got))
      violated(std::string(what) + ": wanted " + text(wanted) + ", got " + text(got));
  }
  [[nodiscard]] Violations done() { return std::move(violations_); }

  /// Calls `step` a grain apart until it is true; false if patience ends before.
  template <class Step>
  bool until(const Step& step) {
    const Time end = rig_.now() + rig_.patience();
    for (;;) {
      if (step()) return true;
      if (rig_.now() > end) return false;
      rig_.pass(rig_.grain());
    }
  }

  /// Sends, and polls until the port says that it has been sent.
  bool send(std::span<const std::uint8_t> request) {
    const auto start = rig_.try_send(request);
    if (!start) {
      violated("a request of " + std::to_string(request.size()) +
               " bytes was refused: " + std::string(tm485::name(start.error())));
      return false;
    }
    const bool sent = until([&] { return rig_.transmission().state != State::sending; });
    if (sent && rig_.transmission().state == State::sent) return true;
    violated(sent ? "a request that was taken has failed" : "a request is never reported as sent");
    return false;
  }

  /// Adds what the far end has heard until it has `count` bytes.
  std::vector<HeardByte> hear(std::size_t count) {
    std::vector<HeardByte> all;
    (void)until([&] {
      const std::vector<HeardByte> more = rig_.heard();
      all.insert(all.end(), more.begin(), more.end());
      return all.size() >= count;
    });
    return all;
  }

  struct Received {
    Bytes bytes;
    std::vector<Errc> faults;
  };

  /// Receives until there are `count` bytes or a fault `until_fault`, and then for a while whatever else comes.
  Received receive(std::size_t count, std::size_t room, Errc until_fault = Errc::ok) {
    Received all;
    Bytes buffer(room);
    bool fault_seen = false;
    const auto take = [&] {
      const Reception reception = rig_.try_receive(buffer);
      if (reception.count > room) {
        violated("more bytes were handed out than the buffer has");
        return true;
      }
      append(all.bytes, std::span(buffer).first(reception.count));
      if (reception.fault != Errc::ok) all.faults.push_back(reception.fault);
      fault_seen = fault_seen || (until_fault != Errc::ok && reception.fault == until_fault);
      return false;
    };
    (void)until([&] { return take() || all.bytes.size() >= count || fault_seen; });
    for (int again = 0; again < kAfterwards; ++again) {
      if (take()) break;
      rig_.pass(rig_.grain());
    }
    return all;
  }

 private:
  static constexpr int kAfterwards = 50;

  Rig& rig_;
  Violations violations_;
};

// Of sending, and of both (checks_sending.cpp).
[[nodiscard]] Violations capability_is_a_constant(Rig& rig);
[[nodiscard]] Violations a_fresh_port_is_idle(Rig& rig);
[[nodiscard]] Violations sends_the_request_and_nothing_else(Rig& rig);
[[nodiscard]] Violations sent_means_off_the_line(Rig& rig);
[[nodiscard]] Violations a_request_is_one_gapless_burst(Rig& rig);
[[nodiscard]] Violations the_start_is_that_of_the_start_bit(Rig& rig);
[[nodiscard]] Violations an_empty_request_is_refused(Rig& rig);
[[nodiscard]] Violations requests_follow_one_another(Rig& rig);
[[nodiscard]] Violations a_request_under_way_is_not_disturbed(Rig& rig);

// Of receiving (checks_receiving.cpp).
[[nodiscard]] Violations bytes_come_once_and_in_order(Rig& rig);
[[nodiscard]] Violations a_late_reader_loses_nothing(Rig& rig);
[[nodiscard]] Violations an_empty_buffer_takes_nothing(Rig& rig);
[[nodiscard]] Violations every_byte_value_passes(Rig& rig);
[[nodiscard]] Violations no_byte_is_lost_in_short_cycles(Rig& rig);
[[nodiscard]] Violations a_character_without_a_stop_bit_is_told(Rig& rig);
[[nodiscard]] Violations lost_bytes_are_told(Rig& rig);
[[nodiscard]] Violations a_port_that_is_gone_says_so(Rig& rig);

}  // namespace tm485::test::conformance
