#include "tm485/bus/exchange.hpp"

#include <algorithm>

namespace tm485 {

void Exchange::on_echo(std::size_t count) noexcept {
  const auto sent = request_.bytes();
  const std::size_t done = sent.size() - echo_left_;
  const auto heard = std::span<const std::uint8_t>(buffer_).first(count);
  if (!std::equal(heard.begin(), heard.end(), sent.begin() + static_cast<std::ptrdiff_t>(done)) &&
      pending_ == Errc::ok)
    pending_ = Errc::echo_mismatch;
  echo_left_ = static_cast<std::uint8_t>(echo_left_ - count);
}

void Exchange::on_time(Time now) noexcept {
  if (state_ != State::waiting || now <= deadline()) return;
  // A port that does not echo loses the head of the reply to the comparison with the echo.
  const std::size_t missing = std::size_t{reply_length_} - received_;
  const bool headless =
      received_ != 0 && buffer_[0] != request_.bytes()[0];  // behind an echo comes the reply's CF
  if (profile_->profile().echo && headless && missing == request_.bytes().size())
    return finish(Errc::echo_mismatch);
  // A fault seen on the way is a better cause than the silence that followed it.
  if (pending_ != Errc::ok) return finish(pending_);
  finish(received_ == 0 ? Errc::timeout : Errc::incomplete_reply);
}

}  // namespace tm485
