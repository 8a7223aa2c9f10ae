#include "tm485/sim/server.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <optional>
#include <span>
#include <string_view>
#include <thread>
#include <utility>

#include "eeprom_file.hpp"
#include "endpoint.hpp"
#include "tm485/sim/burst.hpp"
#include "tm485/sim/line.hpp"

namespace tm485::sim {
namespace {

/// Bytes that are read in one go.
constexpr std::size_t kMostAtOnce = 64;

constexpr int kStopPollMs = 50;
constexpr Time kLongestSleep = std::chrono::milliseconds{kStopPollMs};

/// A sleep may end this much late, so the rest before a deadline is waited for in a loop.
constexpr Time kSpin = std::chrono::microseconds{150};

/// A client's write may reach us in pieces. Within these spans what comes next still belongs to a request
/// that is incomplete, or to one that was bad.
constexpr Time kRequestMayPause = std::chrono::milliseconds{20};
constexpr Time kRefuseMayPause = std::chrono::microseconds{100};

/// A fault that only a line in character time can show.
std::optional<ServerError> refuse_plan(const SimOptions& options) {
  const std::string_view name = options.faults.not_served();
  if (name.empty()) return std::nullopt;
  return ServerError{.what = "fault plan",
                     .reason = "the fault '" + std::string{name} + "' has no meaning for a server",
                     .remedy = "leave it out, or use the simulated port in virtual time: sim:plan=..."};
}

EncoderConfig without_host_timing(EncoderConfig config) {
  config.reset_spacing = Time{0};
  return config;
}

std::int64_t monotonic_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

}  // namespace

Server::Server(const SimOptions& options, std::unique_ptr<Endpoint> endpoint)
    : endpoint_{std::move(endpoint)},
      eeprom_file_{nullptr},
      model_{without_host_timing(options.encoder), options.motion},
      plan_{fault_plan_of(options)},
      plan_seed_{options.seed + 6},
      character_time_{Line{nullptr, options.line}.character_time()},
      echo_{options.line.echo},
      epoch_ns_{monotonic_ns()},
      last_seen_{-kNever},
      request_end_{-kNever},
      line_free_{-kNever} {}

Server::Server(Server&&) noexcept = default;
Server& Server::operator=(Server&&) noexcept = default;
Server::~Server() = default;

std::expected<Server, ServerError> Server::open_pty(const SimOptions& options, const std::string& link_path) {
  if (auto refused = refuse_plan(options)) return std::unexpected{std::move(*refused)};
  auto endpoint = Endpoint::open_pty(link_path);
  if (!endpoint) return std::unexpected{endpoint.error()};
  return Server{options, std::move(*endpoint)};
}

std::expected<Server, ServerError> Server::open_unix(const SimOptions& options, const std::string& path) {
  if (auto refused = refuse_plan(options)) return std::unexpected{std::move(*refused)};
  auto endpoint = Endpoint::open_unix(path);
  if (!endpoint) return std::unexpected{endpoint.error()};
  return Server{options, std::move(*endpoint)};
}

const std::string& Server::path() const noexcept { return endpoint_->path(); }

Time Server::now() const { return Time{monotonic_ns() - epoch_ns_}; }

std::expected<void, ServerError> Server::keep_eeprom(const std::string& path) {
  auto file = std::make_unique<EepromFile>(path);
  const std::span<const std::uint8_t> erased = model_.eeprom().image();
  const auto loaded = file->load(erased.size());
  if (!loaded) return std::unexpected{loaded.error()};
  // Also what was just loaded: a folder that cannot be written is found now and not after the first write.
  const std::span<const std::uint8_t> bytes = *loaded ? std::span<const std::uint8_t>{**loaded} : erased;
  if (auto saved = file->save(bytes); !saved) return saved;
  if (*loaded) static_cast<void>(model_.eeprom().set_image(bytes));
  saved_generation_ = model_.eeprom().generation(now());
  eeprom_file_ = std::move(file);
  return {};
}

std::expected<void, ServerError> Server::save_eeprom(Time now) {
  if (!eeprom_file_) return {};
  const EepromModel& eeprom = model_.eeprom();
  const std::uint64_t generation = eeprom.generation(now);
  if (generation == saved_generation_) return {};
  saved_generation_ = generation;
  const EepromModel::Image image = eeprom.settled_image(now);
  return eeprom_file_->save(std::span{image}.first(eeprom.image().size()));
}

/// Until something has to be done that no client asks for.
int Server::poll_ms() const {
  const Time left = model_.eeprom().busy_until() - now();
  if (!eeprom_file_ || left <= Time{0} || left >= kLongestSleep) return kStopPollMs;
  return static_cast<int>(std::chrono::ceil<std::chrono::milliseconds>(left).count());
}

std::expected<void, ServerError> Server::serve(const std::atomic<bool>& stop) {
  std::array<std::uint8_t, kMostAtOnce> buffer{};
  faults_ = std::make_unique<FaultPlayer>(
      plan_, plan_seed_, FaultPlayer::Stage{.encoder = &model_, .character_time = character_time_});
  while (!stop.load(std::memory_order_relaxed)) {
    const auto count = endpoint_->wait(buffer, poll_ms());
    if (!count) return std::unexpected{count.error()};
    statistics_.clients = endpoint_->clients();
    if (*count != 0) handle(buffer.data(), *count, stop);
    if (auto saved = save_eeprom(now()); !saved) return saved;
  }
  return save_eeprom(kNever);  // an orderly end lets the write under way end
}

/// What the faults do to a request, a burst at a time. `heard` has room for twice as much. Answers how much is heard.
std::size_t Server::disturb_request(std::span<const std::uint8_t> sent, Time start,
                                    std::span<std::uint8_t> heard) {
  std::size_t count = 0;
  while (!sent.empty()) {
    // Half a burst, so that there is room for characters too many.
    const auto part = sent.first(std::min(sent.size(), Burst::kCapacity / 2));
    Burst burst;
    burst.start = start;
    burst.count = static_cast<std::uint8_t>(part.size());
    burst.driver_on = start;
    burst.driver_off = start + character_time_ * burst.count;
    start = burst.driver_off;
    std::ranges::copy(part, burst.bytes.begin());
    static_cast<void>(faults_->on_burst(burst));
    std::copy_n(burst.bytes.begin(), burst.count, heard.begin() + static_cast<std::ptrdiff_t>(count));
    count += burst.count;
    sent = sent.subspan(part.size());
  }
  return count;
}

bool Server::continues_request(Time now) const noexcept {
  if (last_answered_) return false;
  return now - last_seen_ < (model_.mid_request() ? kRequestMayPause : kRefuseMayPause);
}

/// Puts bytes that were read on an imagined wire, one behind the other from now on, and answers when the
/// answer would have passed it. No further bytes are read meanwhile, which holds a flood to the line's rate.
void Server::handle(const std::uint8_t* bytes, std::size_t count, const std::atomic<bool>& stop) {
  const Time seen = now();
  Time start = request_end_;
  if (!continues_request(seen)) {
    start = std::max({seen, request_end_ + model_.config().request_gap, line_free_});
  }
  last_seen_ = seen;
  last_answered_ = false;
  statistics_.bytes_in += count;

  std::array<std::uint8_t, 2 * kMostAtOnce> heard{};
  const std::size_t heard_count = disturb_request(std::span{bytes, count}, start, heard);
  const Time sent_at = start;

  Burst reply;
  for (std::size_t k = 0; k < heard_count; ++k) {
    // At most one of these completes a request: what follows without a gap is ignored by the model.
    Burst answer;
    const Time end = start + character_time_;
    if (model_.on_character(heard[k], start, end, true, Judged::no, answer)) {
      reply = answer;
      last_answered_ = true;
    }
    start = end;
  }
  request_end_ = std::max(start, sent_at + character_time_ * static_cast<std::int64_t>(count));
  if (echo_ || faults_->echoes()) {  // the echo is what the host has sent
    wait_until(request_end_, last_answered_, stop);
    write(bytes, count);
  }
  if (!last_answered_) {
    wait_until(request_end_, false, stop);
    return;
  }
  line_free_ = reply.driver_off;
  static_cast<void>(faults_->on_burst(reply));
  statistics_.bits_flipped = faults_->bits_flipped();
  if (reply.count == 0) {
    ++statistics_.replies_lost;
    return;
  }
  wait_until(reply.start + character_time_ * reply.count, true, stop);
  write(reply.bytes.data(), reply.count);
  ++statistics_.replies;
}

void Server::write(const std::uint8_t* bytes, std::size_t count) {
  statistics_.bytes_dropped += count - endpoint_->write(std::span{bytes, count});
}

/// Sleeps as long as that is safe, and, if it must be exact, loops for the short rest.
void Server::wait_until(Time instant, bool exactly, const std::atomic<bool>& stop) const {
  for (Time left = instant - now(); left > Time{0}; left = instant - now()) {
    if (stop.load(std::memory_order_relaxed)) return;
    if (left > kSpin) {
      std::this_thread::sleep_for(std::min(left - kSpin, kLongestSleep));
    } else if (!exactly) {
      std::this_thread::sleep_for(left);
    }
  }
}

}  // namespace tm485::sim
