// Exchange: one request and its reply, from the first start bit to a verdict.
//
// Bytes and time go in; the verdict comes out. Every wait has a deadline: the wire time, the
// latest T2 and one character, plus what the port may take to hand a byte over.
// Specification: section 4.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "tm485/bus/port.hpp"
#include "tm485/errc.hpp"
#include "tm485/protocol/frame.hpp"
#include "tm485/protocol/profile.hpp"
#include "tm485/protocol/request.hpp"
#include "tm485/time.hpp"

namespace tm485 {

/// One owner. Every function: constant time.
class Exchange {
 public:
  enum class State : std::uint8_t { idle, waiting, done };

  /// A request whose first start bit left at `start`.
  void begin(const Request& request, Time start, const CompiledProfile& profile,
             const PortCapability& port) noexcept;

  /// Where the next received bytes go. Never mixes echo and reply; offers one byte more than the
  /// reply has, so that an overlong one is seen.
  [[nodiscard]] std::span<std::uint8_t> room() noexcept {
    if (echo_left_ != 0) return std::span(buffer_).first(echo_left_);
    return std::span(buffer_).subspan(received_, reply_length_ + 1U - received_);
  }

  /// Bytes that a port has put into room(), at `now`.
  void on_received(const Reception& reception, Time now) noexcept;

  /// The time has come to `now`: past a deadline the exchange is done with timeout or incomplete_reply.
  void on_time(Time now) noexcept;

  /// Nothing more is wanted of it; what still arrives belongs to no exchange.
  void abandon() noexcept { state_ = State::idle; }

  /// The port says that the request was not sent.
  void on_fault(Errc fault) noexcept { finish(fault); }

  [[nodiscard]] State state() const noexcept { return state_; }
  /// While waiting: on_time() must be called at the latest now.
  [[nodiscard]] Time deadline() const noexcept { return deadline_; }

  [[nodiscard]] DataId id() const noexcept { return request_.id(); }
  [[nodiscard]] const Request& request() const noexcept { return request_; }
  [[nodiscard]] Time start() const noexcept { return start_; }
  /// End of the request's last stop bit.
  [[nodiscard]] Time request_end() const noexcept { return request_end_; }

  // Once done:
  /// ok if the bytes of a reply are here (they have not been parsed), or a transport error.
  [[nodiscard]] Errc error() const noexcept { return error_; }
  [[nodiscard]] std::span<const std::uint8_t> reply() const noexcept {
    return std::span(buffer_).first(received_);
  }
  /// End of the request to start of the reply: T2 with wire timestamps, otherwise what the host has
  /// seen. Only if at least one byte came.
  [[nodiscard]] Time reply_delay() const noexcept { return reply_delay_; }
  [[nodiscard]] bool has_reply_delay() const noexcept { return received_ != 0; }

 private:
  void on_echo(std::size_t count) noexcept;
  void finish(Errc error) noexcept {
    error_ = error;
    state_ = State::done;
  }

  static constexpr std::size_t kRoom = kMaxReply + 1;  // one for the byte too many

  std::array<std::uint8_t, kRoom> buffer_{};
  std::uint8_t received_ = 0;
  std::uint8_t reply_length_ = 0;
  std::uint8_t echo_left_ = 0;
  State state_ = State::idle;
  Errc error_ = Errc::ok;
  Errc pending_ = Errc::ok;  ///< found before the reply was complete; reported when it is
  bool wire_timestamps_ = false;
  Request request_ = *Request::make(DataId::everything);
  Time start_{0};
  Time request_end_{0};
  Time deadline_{0};
  Time reply_delay_{0};
  const CompiledProfile* profile_ = nullptr;  ///< since begin()
};

inline void Exchange::begin(const Request& request, Time start, const CompiledProfile& profile,
                            const PortCapability& port) noexcept {
  const Layout& row = layout(request.id());
  request_ = request;
  start_ = start;
  request_end_ = start + profile.characters(row.request_length);
  profile_ = &profile;
  wire_timestamps_ = port.wire_timestamps;
  reply_length_ = row.reply_length;
  received_ = 0;
  echo_left_ = profile.profile().echo ? row.request_length : std::uint8_t{0};
  error_ = Errc::ok;
  pending_ = Errc::ok;
  reply_delay_ = Time{0};
  deadline_ = request_end_ + profile.characters(row.reply_length + 1U) + profile.profile().t2_max +
              port.latency_allowance;
  state_ = State::waiting;
}

inline void Exchange::on_received(const Reception& reception, Time now) noexcept {
  if (state_ != State::waiting) return;
  if (reception.fault == Errc::port_gone) return finish(Errc::port_gone);
  if (reception.fault != Errc::ok && pending_ == Errc::ok) pending_ = reception.fault;
  if (reception.count == 0) return;
  if (echo_left_ != 0) return on_echo(reception.count);
  if (received_ == 0) {
    reply_delay_ = (wire_timestamps_ ? reception.first_start : now) - request_end_;
    const Profile& profile = profile_->profile();
    const bool early_or_late = reply_delay_ < profile.t2_min || reply_delay_ > profile.t2_max;
    if (wire_timestamps_ && early_or_late && pending_ == Errc::ok) [[unlikely]]
      pending_ = Errc::t2_out_of_window;
  }
  received_ = static_cast<std::uint8_t>(received_ + reception.count);
  if (received_ < reply_length_) return;
  finish(received_ > reply_length_ ? Errc::overlong_reply : pending_);
}

}  // namespace tm485
