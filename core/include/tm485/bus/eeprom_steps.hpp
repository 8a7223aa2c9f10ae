// Bodies of BasicEepromManager. Included by eeprom.hpp.
#pragma once

#include "tm485/bus/eeprom.hpp"

namespace tm485 {

// --- Tasks ---

template <class D>
std::expected<void, Errc> BasicEepromManager<D>::begin(Task task, unsigned first,
                                                       std::size_t count) noexcept {
  if (active()) return std::unexpected(Errc::busy);
  if (count == 0 || count > size() || first > size() - count) return std::unexpected(Errc::bad_argument);
  const bool knows = !known_.value.empty() || !known_.known.empty();
  if (knows && (known_.value.size() != size() || known_.known.size() != size()))
    return std::unexpected(Errc::bad_argument);
  task_ = task;
  first_ = first;
  count_ = static_cast<unsigned>(count);
  outcome_.reset();
  first_mismatch_.reset();
  progress_ = {};
  progress_.total = count_;
  cancelled_ = false;
  phase_ = Phase::read;
  suspect_ = Suspect::none;
  doubted_ = 0;
  tries_ = rewrites_ = selects_ = sweeps_ = busy_looks_ = rounds_ = 0;
  once_more_ = false;
  wait_until_ = Time{0};
  failing_since_ = kNever;
  unsent_ = false;
  // Begins in the page that is selected now, if the range has all of it from its first byte: one change less.
  const unsigned here = page_ ? unsigned{*page_} * profile_->profile().eeprom_page_bytes : 0;
  at_ = here > first_ && here < first_ + count_ ? here : first_;
  return {};
}

template <class D>
std::expected<void, Errc> BasicEepromManager<D>::start_read(unsigned first,
                                                            std::span<std::uint8_t> to) noexcept {
  const auto begun = begin(Task::read, first, to.size());
  if (begun) to_ = to;
  return begun;
}

template <class D>
std::expected<void, Errc> BasicEepromManager<D>::start_write(unsigned first,
                                                             std::span<const std::uint8_t> from) noexcept {
  const auto begun = begin(Task::write, first, from.size());
  if (begun) from_ = from;
  return begun;
}

template <class D>
std::expected<void, Errc> BasicEepromManager<D>::start_verify(unsigned first,
                                                              std::span<const std::uint8_t> with) noexcept {
  const auto begun = begin(Task::verify, first, with.size());
  if (begun) from_ = with;
  return begun;
}

template <class D>
void BasicEepromManager<D>::end(const EepromError& outcome) noexcept {
  outcome_ = outcome;
  task_ = Task::none;
}

template <class D>
void BasicEepromManager<D>::fail(Errc code, std::uint8_t wanted, std::uint8_t found) noexcept {
  end({code, page_of(target()), address_of(target()), wanted, found});
}

/// The task's byte is dealt with.
template <class D>
void BasicEepromManager<D>::next_byte() noexcept {
  phase_ = Phase::read;
  rewrites_ = 0;
  sweeps_ = 0;
  const unsigned before = at_;
  if (++at_ == first_ + count_) at_ = first_;
  if (++progress_.done != count_) return;
  if (!once_more_) return end(first_mismatch_.value_or(EepromError{}));
  if (++rounds_ > kMostRounds) return end({unheard_, page_of(before), address_of(before)});
  once_more_ = false;
  progress_.done = 0;
}

template <class D>
Time BasicEepromManager<D>::time_left() const noexcept {
  if (!active()) return Time{0};
  const Profile& p = profile_->profile();
  const Time look = profile_->t1(DataId::eeprom_read);
  const auto left = static_cast<std::int64_t>(progress_.total - progress_.done);
  const Time each = task_ == Task::write ? p.eeprom_write_time + 2 * look : look;
  return each * left + p.eeprom_page_time * (left / p.eeprom_page_bytes);
}

template <class D>
std::optional<EepromDoubt> BasicEepromManager<D>::in_doubt() const noexcept {
  if (outcome_ && outcome_->code == Errc::ok) return std::nullopt;
  const bool writing = under_way_ && (action_ == Action::write || action_ == Action::select_page);
  const bool unread = phase_ == Phase::read_back || rewrites_ != 0;
  const bool unfinished = once_more_ || rounds_ != 0;
  if (!writing && !unread && !unfinished && doubted_ == 0) return std::nullopt;
  const unsigned at = unread ? at_ : target();
  const std::uint32_t pages = doubted_ | (unfinished ? progress_.unconfirmed_pages : 0);
  return EepromDoubt{page_of(at), address_of(at), pages | (writing ? bit(page_.value_or(0)) : 0)};
}

// --- What is next ---

template <class D>
auto BasicEepromManager<D>::choose() const noexcept -> Action {
  // First of all: which page is it? An echo that names another byte can be followed up only if that is known.
  if (D::kChecksPage && page_looks_ < kPageLooks) return Action::check_page;
  if (page_ != page_of(target())) return Action::select_page;
  return writes() ? Action::write : Action::read;
}

template <class D>
Request BasicEepromManager<D>::request_for(Action action) const noexcept {
  const std::uint8_t address = address_of(target());
  switch (action) {
    case Action::check_page:
      return *Request::eeprom_read(kPageRegister);
    case Action::select_page:
      return *Request::eeprom_write(kPageRegister, page_of(target()));
    case Action::write:
      return *Request::eeprom_write(address,
                                    suspect_ == Suspect::none ? from_[at_ - first_] : known_.value[other_]);
    case Action::read:
      break;
  }
  return *Request::eeprom_read(address);
}

template <class D>
std::optional<Request> BasicEepromManager<D>::next(Time now) noexcept {
  if (!active() || under_way_ || now < wait_until_) return std::nullopt;
  // Who was heard less than half a boot time ago has not restarted since.
  if (now - last_heard_ > profile_->profile().boot_time_min / 2) doubt_page();
  action_ = choose();
  if (cancelled_ && phase_ == Phase::read && suspect_ == Suspect::none && action_ != Action::check_page) {
    end({Errc::abandoned, page_of(at_), address_of(at_)});
    return std::nullopt;
  }
  if (action_ == Action::select_page) {
    if (++selects_ > kMostSelects) {
      fail(Errc::eeprom_page_refused, page_of(target()), page_.value_or(0xFF));
      return std::nullopt;
    }
    ++progress_.page_selects;
  }
  if (action_ == Action::write) ++progress_.writes;
  under_way_ = true;
  return request_for(action_);
}

// --- What came of it ---

template <class D>
void BasicEepromManager<D>::on_refused(Errc cause, Time now) noexcept {
  under_way_ = false;
  if (cause == Errc::no_gap || cause == Errc::bad_argument) return fail(cause);
  on_unsent(cause, now);
}

template <class D>
void BasicEepromManager<D>::on_completion(const Completion& completion, Time now) noexcept {
  under_way_ = false;
  if (!active()) return;
  const bool wrote = action_ == Action::write || action_ == Action::select_page;
  const Errc error = completion.result ? Errc::ok : completion.result.error();
  // The bus had no gap for it in all its patience, or stopped first.
  if (error == Errc::no_gap || error == Errc::bad_state) return on_unsent(error, now);
  if (!completion.heard) return on_failure(error == Errc::ok ? Errc::bad_state : error, now);
  const Frame& heard = completion.heard->frame();
  last_heard_ = now;
  if (error == Errc::eeprom_busy && D::kChecksBusy) return on_busy(now);
  if (error == Errc::eeprom_address_mismatch) {
    if (!wrote) return on_failure(error, now);
    if (D::kComparesEcho) return on_wrong_echo(heard, now);
  }
  busy_looks_ = 0;
  // A look at the page fits where a write does not.
  if (!unsent_ || action_ != Action::check_page) {
    tries_ = 0;
    failing_since_ = kNever;
    unsent_ = false;
  }
  if (wrote) return on_echo(now);
  on_data(heard.edf());
}

/// The data of a busy reply are void. Asked again, a bounded number of times.
template <class D>
void BasicEepromManager<D>::on_busy(Time now) noexcept {
  failing_since_ = kNever;
  if (++busy_looks_ > kMostBusy) return fail(Errc::eeprom_busy);
  wait_until_ = now + kBusyPause;
}

/// Tried again, unless that has gone on for too long.
template <class D>
void BasicEepromManager<D>::try_again(Errc cause, Time now) noexcept {
  const Profile& p = profile_->profile();
  ++progress_.retries;
  if (failing_since_ == kNever) failing_since_ = now;
  if (tries_ < kMostTries) ++tries_;
  if (tries_ == kMostTries && now - failing_since_ > 2 * p.power_up_time) return fail(cause);
  // Against noise at once; an encoder that boots is asked a few times a boot time.
  wait_until_ = now + (tries_ <= 3 ? Time{0} : std::max(p.boot_time_min / 8, Time{1'000'000}));
}

/// Nothing was sent, so nothing has changed and nothing is in doubt.
template <class D>
void BasicEepromManager<D>::on_unsent(Errc cause, Time now) noexcept {
  if (action_ == Action::select_page) {
    --selects_;
    --progress_.page_selects;
  }
  if (action_ == Action::write) --progress_.writes;
  unsent_ = true;
  try_again(cause, now);
}

/// No reply that can be used. A write may have done its work all the same: that is looked at, not assumed.
template <class D>
void BasicEepromManager<D>::on_failure(Errc cause, Time now) noexcept {
  const Profile& p = profile_->profile();
  doubt_page();
  try_again(cause, now);
  if (!active() || (action_ != Action::write && action_ != Action::select_page)) return;
  wait_until_ = std::max(wait_until_, now + std::max(p.eeprom_write_time, p.eeprom_page_time));
  if (action_ == Action::write && suspect_ == Suspect::none) phase_ = Phase::read_back;
  // Noise may have made another write of it, and nobody has heard which.
  unheard_ = cause;
  doubt_bytes_of(page_.value_or(0));
}

/// Every byte of the page is compared with what is known of it, before anything else.
template <class D>
void BasicEepromManager<D>::doubt_bytes_of(std::uint8_t page) noexcept {
  if (page >= profile_->profile().eeprom_pages) return;
  if (known_.known.empty()) {
    progress_.unconfirmed_pages |= bit(page);
    once_more_ = task_ == Task::write;
    return;
  }
  if (++sweeps_ > kMostSweeps) return fail(Errc::eeprom_mismatch);
  doubted_ |= bit(page);
  if (suspect_ == Suspect::none || page_of(other_) == page) begin_sweep();
}

/// With the page that is selected, if it is in doubt: one change less.
template <class D>
void BasicEepromManager<D>::begin_sweep() noexcept {
  suspect_ = Suspect::none;
  if (doubted_ == 0) return;
  unsigned page = 0;
  if (page_ && (doubted_ & bit(*page_)) != 0) page = *page_;
  while ((doubted_ >> page & 1U) == 0) ++page;
  suspect_ = Suspect::look;
  other_ = page * profile_->profile().eeprom_page_bytes;
}

template <class D>
void BasicEepromManager<D>::suspect_settled() noexcept {
  suspect_ = Suspect::look;
  if (++other_ % profile_->profile().eeprom_page_bytes != 0) return;
  doubted_ &= ~bit(page_of(other_ - 1));
  begin_sweep();
}

/// The encoder did something else than it was asked; the echo says what.
template <class D>
void BasicEepromManager<D>::on_wrong_echo(const Frame& echo, Time now) noexcept {
  const Profile& p = profile_->profile();
  ++progress_.retries;
  wait_until_ = now + std::max(p.eeprom_write_time, p.eeprom_page_time);
  doubt_page();
  if (action_ == Action::write && suspect_ == Suspect::none) phase_ = Phase::read_back;
  if (echo.address() >= p.eeprom_page_bytes) return;  // the page register: it is looked at in any case
  const std::uint8_t page = page_.value_or(0);
  const unsigned named = unsigned{page} * p.eeprom_page_bytes + echo.address();
  const bool is_known = named < known_.known.size() && known_.known[named];
  if (!is_known) return end({Errc::eeprom_mismatch, page, echo.address(), echo.edf(), echo.edf()});
  doubt_bytes_of(page);
}

/// The encoder has taken a write; it is not done yet.
template <class D>
void BasicEepromManager<D>::on_echo(Time now) noexcept {
  const Profile& p = profile_->profile();
  if (action_ == Action::select_page) {
    wait_until_ = now + p.eeprom_page_time;
    page_ = page_of(target());
    doubt_page();
    if (!D::kChecksPage) selects_ = 0;
    return;
  }
  wait_until_ = now + p.eeprom_write_time;
  if (suspect_ == Suspect::restore) {
    suspect_ = Suspect::look_again;
    return;
  }
  if (D::kReadsBack) {
    phase_ = Phase::read_back;
    return;
  }
  know(at_, from_[at_ - first_]);
  next_byte();
}

template <class D>
void BasicEepromManager<D>::on_data(std::uint8_t data) noexcept {
  if (action_ == Action::check_page) {
    const bool another = page_looks_ != 0 && page_ != data;
    page_looks_ = another ? std::uint8_t{1} : static_cast<std::uint8_t>(page_looks_ + 1);
    page_ = data;
    if (another && ++selects_ > kMostSelects) return fail(Errc::eeprom_page_refused, page_of(target()), data);
    if (page_looks_ == kPageLooks && data == page_of(target())) selects_ = 0;
    return;
  }
  if (suspect_ != Suspect::none) return on_suspect_data(data);
  on_task_data(data);
}

template <class D>
void BasicEepromManager<D>::on_task_data(std::uint8_t data) noexcept {
  const unsigned index = at_ - first_;
  if (task_ == Task::read) {
    to_[index] = data;
    know(at_, data);
    return next_byte();
  }
  const std::uint8_t wanted = from_[index];
  if (data == wanted) {
    know(at_, data);
    return next_byte();
  }
  if (task_ == Task::verify) {
    ++progress_.mismatches;
    if (!first_mismatch_)
      first_mismatch_ = EepromError{Errc::eeprom_mismatch, page_of(at_), address_of(at_), wanted, data};
    return next_byte();
  }
  if (phase_ == Phase::read_back && ++rewrites_ > kMostRewrites)
    return fail(Errc::eeprom_mismatch, wanted, data);
  phase_ = Phase::write;
}

/// A byte that noise may have changed: what was known of it is put back.
template <class D>
void BasicEepromManager<D>::on_suspect_data(std::uint8_t data) noexcept {
  // The task's own, of which the echo is missing: it is read back anyway.
  if (other_ == at_ && phase_ == Phase::read_back) return suspect_settled();
  if (!known_.known[other_]) {
    progress_.unconfirmed_pages |= bit(page_of(other_));
    return suspect_settled();
  }
  if (data == known_.value[other_]) {
    if (suspect_ == Suspect::look_again) ++progress_.repaired;
    return suspect_settled();
  }
  if (suspect_ == Suspect::look_again && ++rewrites_ > kMostRewrites)
    return fail(Errc::eeprom_mismatch, known_.value[other_], data);
  suspect_ = Suspect::restore;
}

template <class D>
void BasicEepromManager<D>::know(unsigned at, std::uint8_t value) noexcept {
  if (known_.known.empty()) return;
  known_.value[at] = value;
  known_.known[at] = true;
}

}  // namespace tm485
