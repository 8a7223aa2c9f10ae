#include "campaign/recorder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <string_view>

namespace tm485::cli::campaign {
namespace {

constexpr unsigned kDataBits = 8;

std::string bytes_of(const sim::Burst& burst) {
  std::string text;
  for (unsigned k = 0; k < burst.count; ++k)
    text += fmt::format("{}{:02X}{}", k == 0 ? "" : " ", burst.bytes[k],
                        ((burst.framing_errors >> k) & 1u) != 0 ? "!" : "");
  return text.empty() ? "-" : text;
}

/// Changes of signals in the order of time.
class Wave {
 public:
  void set(Time at, char signal, std::string value) {
    changes_.emplace(at, std::pair(signal, std::move(value)));
  }
  void bit(Time at, char signal, bool level) { set(at, signal, level ? "1" : "0"); }
  void number(Time at, char signal, std::uint64_t value, unsigned bits) {
    std::string text = "b";
    for (unsigned k = bits; k > 0; --k) text += ((value >> (k - 1)) & 1u) != 0 ? '1' : '0';
    set(at, signal, text + ' ');
  }
  [[nodiscard]] std::string text() const {
    std::string out;
    Time last = -kNever;
    for (const auto& [at, change] : changes_) {
      if (at != last) out += fmt::format("#{}\n", at.count());
      last = at;
      out += change.second + change.first + '\n';
    }
    return out;
  }

 private:
  std::multimap<Time, std::pair<char, std::string>> changes_;
};

constexpr std::string_view kHeader =
    "$comment tm485 campaign $end\n"
    "$timescale 1 ns $end\n"
    "$scope module tm485 $end\n"
    "$var wire 1 L line $end\n"
    "$var wire 1 D de $end\n"
    "$var wire 1 E de_encoder $end\n"
    "$var wire 8 Q request $end\n"
    "$var wire 8 R reply $end\n"
    "$var wire 1 V valid $end\n"
    "$var wire 2 S quality $end\n"
    "$var wire 1 F fault $end\n"
    "$var wire 64 P position $end\n"
    "$var wire 64 T shaft $end\n"
    "$upscope $end\n"
    "$enddefinitions $end\n"
    "$dumpvars\n1L\n0D\n0E\nbxxxxxxxx Q\nbxxxxxxxx R\n0V\nb00 S\n0F\nbx P\nbx T\n$end\n";

void draw_burst(Wave& wave, const sim::Burst& burst, Time character) {
  const char driver = burst.talker == sim::Talker::host ? 'D' : 'E';
  const char bytes = burst.talker == sim::Talker::host ? 'Q' : 'R';
  if (burst.talker != sim::Talker::third) {
    wave.bit(std::max(burst.driver_on, Time{0}), driver, true);
    wave.bit(burst.driver_off, driver, false);
  }
  const Time bit = character / 10;
  for (unsigned k = 0; k < burst.count; ++k) {
    const Time start = burst.start + character * k;
    wave.bit(start, 'L', false);
    for (unsigned b = 0; b < kDataBits; ++b)
      wave.bit(start + bit * (1 + b), 'L', ((burst.bytes[k] >> b) & 1) != 0);
    wave.bit(start + bit * (1 + kDataBits), 'L', ((burst.framing_errors >> k) & 1u) == 0);
    if (burst.talker != sim::Talker::third) wave.number(start, bytes, burst.bytes[k], kDataBits);
  }
  const Time end = burst.start + character * burst.count;
  wave.bit(end, 'L', true);
  if (burst.talker != sim::Talker::third) wave.set(end, bytes, "bxxxxxxxx ");
}

}  // namespace

void Recorder::begin(sim::SimulatedEncoder& encoder) {
  inner_ = &encoder.faults();
  character_ = encoder.line().character_time();
  encoder.line().set_fault_hook(this);
}

void Recorder::keep(const sim::Burst& burst) {
  if (cycle_ >= first_cycle_ && bursts_.size() < kMostEvents) bursts_.push_back(burst);
}

bool Recorder::on_burst(sim::Burst& burst) noexcept {
  const bool altered = inner_->on_burst(burst);
  keep(burst);
  return altered;
}

bool Recorder::on_own(sim::Burst& burst) noexcept {
  const bool speaks = inner_->on_own(burst);
  if (speaks) keep(burst);
  return speaks;
}

void Recorder::note(const CycleRecord& record, const Sample& sample, sim::SimulatedEncoder& encoder,
                    Time now) {
  if (exchanges_.size() == kMostEvents) return;
  exchanges_.push_back({.record = record,
                        .sample = sample,
                        .cycle = cycle_,
                        .truth = encoder.model().shaft_counts(sample.latch_time()),
                        .bursts_before = bursts_.size(),
                        .now = now,
                        .touched = inner_->effects().touched,
                        .changed = inner_->effects().bits_changed});
}

std::string Recorder::table() const {
  std::string out =
      fmt::format("{:>8} {:>14} {:<10} {:<34} {:<34} {:<20} {:<8} {:>12} {:>10} {}\n", "cycle", "time us",
                  "exchange", "request", "reply", "result", "sample", "position", "off", "fault");
  std::size_t burst = 0;
  for (const Exchange& exchange : exchanges_) {
    std::string request;
    std::string reply;
    std::string others;
    for (; burst < exchange.bursts_before; ++burst) {
      const sim::Burst& b = bursts_[burst];
      std::string& to = b.talker == sim::Talker::host      ? request
                        : b.talker == sim::Talker::encoder ? reply
                                                           : others;
      to += (to.empty() ? "" : " | ") + bytes_of(b);
    }
    constexpr std::array<std::string_view, 3> kKinds{"start-up", "cycle", "background"};
    const bool known = exchange.sample.quality() != Quality::invalid;
    out += fmt::format("{:>8} {:>14.3f} {:<10} {:<34} {:<34} {:<20} {:<8} {:>12} {:>10} {}{}\n",
                       exchange.cycle, static_cast<double>(exchange.record.start.count()) * 1e-3,
                       kKinds[static_cast<std::size_t>(exchange.record.kind)], request, reply,
                       describe(exchange.record.result).name, name(exchange.sample.quality()),
                       known ? fmt::format("{}", exchange.sample.position()) : "-",
                       known ? fmt::format("{}", exchange.sample.position() - exchange.truth) : "-",
                       exchange.changed   ? "changed"
                       : exchange.touched ? "touched"
                                          : "",
                       others.empty() ? "" : " somebody: " + others);
  }
  return out;
}

std::string Recorder::vcd() const {
  Wave wave;
  for (const sim::Burst& burst : bursts_) draw_burst(wave, burst, character_);
  for (const Exchange& exchange : exchanges_) {
    const bool fresh = exchange.sample.quality() == Quality::fresh;
    wave.bit(exchange.now, 'V', exchange.sample.quality() != Quality::invalid);
    wave.number(exchange.now, 'S', static_cast<std::uint64_t>(exchange.sample.quality()), 2);
    wave.bit(exchange.now, 'F', exchange.touched);
    if (!fresh) continue;
    wave.number(exchange.now, 'P', static_cast<std::uint64_t>(exchange.sample.position()), 64);
    wave.number(exchange.now, 'T', static_cast<std::uint64_t>(exchange.truth), 64);
  }
  return std::string(kHeader) + wave.text();
}

}  // namespace tm485::cli::campaign
