// A whole bus on a port that does what the bytes say: late, lost, changed, foreign and superfluous bytes, faults,
// encoder restarts, background requests. Judged: T1; every poll moves on; nothing is called fresh unless the port has
// just handed out the whole, unchanged reply (by the slow decoder); what was offered is completed once; the statistics
// add up; and once the line is good again the bus recovers.
#include <algorithm>
#include <vector>

#include "fuzz/input.hpp"
#include "fuzz/targets.hpp"
#include "support/frames.hpp"
#include "support/profiles.hpp"
#include "support/scripted_port.hpp"
#include "support/slow_decoder.hpp"
#include "tm485/bus/bus.hpp"

namespace tm485::fuzz {
namespace {

constexpr std::size_t kMostPolls = 20'000;
constexpr std::size_t kMostRequests = 400;  ///< of the script; then the line is good
constexpr Time kRecovery = std::chrono::seconds(3);
constexpr Time kCharacter{4'000};
constexpr Time kCycle{62'500};

/// The scripted port, with a record of what it has handed out since the last request.
class Recorder {
 public:
  test::ScriptedPort port;
  std::vector<std::uint8_t> heard;
  Errc fault = Errc::ok;
  Time first{0};

  [[nodiscard]] PortCapability capability() const noexcept { return port.capability(); }
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    heard.clear();
    fault = Errc::ok;
    return port.try_send(request, now);
  }
  [[nodiscard]] Transmission transmission(Time now) const noexcept { return port.transmission(now); }
  [[nodiscard]] Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
    const Reception reception = port.try_receive(buffer, now);
    if (heard.empty() && reception.count != 0) first = reception.first_start;
    heard.insert(heard.end(), buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(reception.count));
    if (fault == Errc::ok) fault = reception.fault;
    return reception;
  }
};

const test::Kind& kind_of(const test::Bytes& request) {
  for (const test::Kind& kind : test::kKinds)
    if (kind.cf == request.at(0)) return kind;
  require(false, "every request has a CF of the nine");
  return test::kKinds[0];
}

class Play {
 public:
  explicit Play(std::span<const std::uint8_t> bytes) : input_(bytes) {}
  int run();

 private:
  void answer(const test::Bytes& request, Time start, test::ScriptedPort::Answer& answer);
  void disturb(Bus<Recorder>& bus);
  void check_new_sample(Bus<Recorder>& bus);
  void check_t1();

  Input input_;
  Recorder recorder_;
  test::PlainEncoder encoder_;
  const test::SlowProfile* slow_ = nullptr;
  Profile profile_;
  std::optional<CompiledProfile> compiled_;
  std::uint32_t step_ =
      0;  ///< by which the shaft turns in kCycle, counts: evenly, or its acceleration would have no bound
  Time turned_at_{0};
  std::int64_t turned_ = 0;  ///< since then less than a count, in counts / kCycle
  Time now_{0};
  std::uint32_t sequence_ = 0;
  std::size_t checked_ = 0;
  int offered_ = 0;
  int completed_ = 0;
  std::optional<Time> deaf_until_;
};

void Play::answer(const test::Bytes& request, Time start, test::ScriptedPort::Answer& answer) {
  const std::uint32_t range = std::uint32_t{1} << profile_.single_turn_bits;
  turned_ += (start - turned_at_).count() * step_;
  turned_at_ = start;
  encoder_.abs = static_cast<std::uint32_t>((encoder_.abs + turned_ / kCycle.count()) % range);
  turned_ %= kCycle.count();
  answer.bytes = encoder_.reply(request);
  if (recorder_.port.sent.size() > kMostRequests || input_.empty()) return;
  const auto at = [&] { return answer.bytes.empty() ? 0U : input_.u8() % answer.bytes.size(); };
  switch (input_.below(24)) {
    case 0:
      answer.bytes.clear();
      break;
    case 1:
      if (!answer.bytes.empty()) answer.bytes[at()] ^= static_cast<std::uint8_t>(1U << input_.below(8));
      break;
    case 2:
      answer.bytes.resize(at());
      break;
    case 3:
      answer.bytes.push_back(input_.u8());
      break;
    case 4: {
      const auto raw = input_.bytes(input_.below(14));
      answer.bytes.assign(raw.begin(), raw.end());
      break;
    }
    case 5: {  // with a good checksum
      const auto raw = input_.bytes(input_.below(12));
      answer.bytes = test::sealed({raw.begin(), raw.end()});
      break;
    }
    case 6:
      answer.t2 = Time{input_.u16()};
      break;
    case 7:
      answer.fault = input_.flag() ? Errc::overrun : Errc::framing_error;
      break;
    case 8:
      answer.late = Time{std::int64_t{input_.u16()} * 32};
      break;
    case 9:  // another talker, some time
      recorder_.port.inject(start + Time{input_.u16()}, {input_.u8(), input_.u8()});
      break;
    case 10:
      encoder_.abs = input_.u32() % range;  // a coupling that slips
      break;
    case 11:
      encoder_.abm = static_cast<std::uint32_t>(input_.u16());
      break;
    case 12:
      encoder_.sf = input_.u8();
      encoder_.almc = input_.u8();
      break;
    case 13:
      step_ = input_.u16() % 64;
      break;
    case 14:
      answer.bytes = encoder_.reply({test::kKinds[input_.below(4)].cf});  // to another request
      break;
    default:
      break;
  }
}

void Play::disturb(Bus<Recorder>& bus) {
  switch (input_.below(64)) {
    case 0:
      bus.on_restart(now_);
      break;
    case 1: {
      const test::Kind& kind = test::kKinds[input_.below(9)];
      const auto request = kind.id == 13  ? Request::eeprom_read(input_.u8() & 0x7FU)
                           : kind.id == 6 ? Request::eeprom_write(input_.u8() & 0x7FU, input_.u8())
                                          : Request::make(static_cast<DataId>(kind.id));
      if (bus.offer(*request)) ++offered_;
      break;
    }
    case 2:
      recorder_.port.refuses = !recorder_.port.refuses;
      break;
    case 3:
      recorder_.port.gone = !recorder_.port.gone;
      break;
    case 4:
      bus.hold_line(now_ + Time{std::int64_t{input_.u16()} * 16},
                    input_.flag() ? LineHold::no_cycle : LineHold::resets_only);
      break;
    case 5:
      bus.release_line(now_);
      break;
    case 6:
      recorder_.port.stuck_as = static_cast<Transmission::State>(input_.below(4));
      break;
    case 7:
      now_ += Time{std::int64_t{input_.u16()} * 64};  // the host was away
      break;
    case 8:
      recorder_.port.inject(now_ + Time{input_.u8()}, {input_.u8()});
      break;
    case 9:
      bus.on_servo_tick(now_ - Time{input_.u16()});
      break;
    case 10:
      if (bus.take_completion()) ++completed_;
      break;
    default:
      break;
  }
}

void Play::check_new_sample(Bus<Recorder>& bus) {
  const Sample& sample = bus.latest();
  if (sample.sequence() == sequence_) return;
  sequence_ = sample.sequence();
  if (sample.quality() != Quality::fresh) return;
  require(bus.state() == BusState::running, "nothing is fresh before start-up is through");
  require(!recorder_.port.sent.empty(), "nothing is fresh without a request");
  const test::Bytes& request = recorder_.port.sent.back().bytes;
  const std::size_t echoed = profile_.echo ? request.size() : 0;
  require(recorder_.heard.size() >= echoed, "the echo was heard");
  const std::span<const std::uint8_t> reply = std::span<const std::uint8_t>(recorder_.heard).subspan(echoed);
  const test::Kind& kind = kind_of(request);
  const test::SlowReply slow = test::slow_parse(reply, kind.id, *slow_);
  require(slow.error == "ok", "fresh without a whole and valid reply");
  require(recorder_.fault == Errc::ok, "fresh although the port reported a fault");
  require(number(sample.id()) == kind.id, "the ID of the request");
  if (test::shape_of(kind.id).contains('a')) require(sample.single_turn() == slow.abs, "its position");
  const Time end = recorder_.port.sent.back().start + kCharacter * static_cast<std::int64_t>(request.size());
  if (recorder_.port.capability_.wire_timestamps) {
    require(sample.latch_time() == end + profile_.latch_offset, "its latch time");
    if (!profile_.echo)
      require(recorder_.first - end >= profile_.t2_min && recorder_.first - end <= profile_.t2_max, "its T2");
  }
  require(sample.latch_time() <= now_, "latched in the past");
}

void Play::check_t1() {
  const auto& sent = recorder_.port.sent;
  for (; checked_ + 1 < sent.size(); ++checked_) {
    const test::Kind& kind = kind_of(sent[checked_].bytes);
    const Time t1 = profile_.t1[index_of(static_cast<DataId>(kind.id))];
    require(sent[checked_ + 1].start - sent[checked_].start >= t1, "T1");
  }
}

int Play::run() {
  slow_ = &test::kSlowProfiles[input_.below(10)];
  profile_ = test::preset(slow_->name);
  profile_.echo = input_.flag();
  compiled_ = test::compiled(profile_);
  encoder_.enid = slow_->enid_count == 0 ? std::uint8_t{0x11} : slow_->enids[0];
  if (profile_.multi_turn_bits == 0) encoder_.abm = 0;
  test::ScriptedPort& port = recorder_.port;
  port.echo = profile_.echo;
  if (input_.flag()) {
    const Time allowance{std::int64_t{input_.u8()} * 1'000};
    port.be_slow(allowance);
    port.delivery = allowance * input_.below(5) / 4;
    port.capability_.shortest_exchange = Time{std::int64_t{input_.u8()} * 1'000};
  } else {
    const Time most{std::int64_t{input_.u8()} * 500};
    port.lateness = [this, most] { return input_.empty() ? Time{0} : most * input_.u8() / 256; };
  }
  port.capability_.jitter_margin = Time{std::int64_t{input_.u8()} * 100};
  port.answer = [this](const test::Bytes& request, Time start) {
    test::ScriptedPort::Answer reply;
    answer(request, start, reply);
    return reply;
  };

  BusConfig config;
  const auto any_id = [&] { return static_cast<DataId>(input_.below(4)); };
  config.cycle = Pattern(Time{std::int64_t{input_.u8()} * 2'000}, {{any_id(), 1, 1}});
  for (unsigned more = input_.below(4); more > 0; --more)
    config.cycle->add({any_id(), static_cast<std::uint8_t>(input_.below(4))});
  if (input_.below(8) == 0) config.cycle.reset();
  config.steal_every = static_cast<std::uint16_t>(input_.below(5));
  config.eeprom_may_hold = input_.flag();
  config.startup_frames = static_cast<std::uint8_t>(input_.below(6));
  config.max_hold = Time{std::int64_t{input_.u8()} * 50'000};
  config.lost_after = Time{std::int64_t{input_.u8()} * 100'000};
  if (input_.below(4) == 0)
    config.phase =
        Phase::locked_to({.period = Time{std::int64_t{input_.u8()} * 2'000}, .lead = Time{input_.u16()}});

  Bus<Recorder> bus(recorder_, *compiled_, config);
  if (!bus.start(now_)) return 0;
  int in_place = 0;
  std::size_t polls = 0;
  while (!input_.empty() && polls < kMostPolls && port.sent.size() < kMostRequests) {
    const Time asked = bus.poll(now_);
    check_new_sample(bus);
    check_t1();
    const Time due = std::min(asked, port.next_event(now_));
    in_place = due > now_ ? 0 : in_place + 1;
    require(in_place <= 100, "the bus moves on");
    now_ = std::max(now_, std::min(due, now_ + std::chrono::milliseconds(50)));
    disturb(bus);
    ++polls;
  }

  // From here on the line is good.
  port.refuses = port.gone = false;
  port.stuck_as = Transmission::State::sent;
  bus.release_line(now_);
  const Time limit = now_ + kRecovery;
  const bool reads = config.cycle.has_value();
  const auto recovered = [&] {
    return bus.state() == BusState::running && (!reads || bus.latest().quality() == Quality::fresh);
  };
  bool waits = config.phase.kind == Phase::Kind::servo;  // for its ticks
  while (!recovered() && !waits && now_ < limit) {
    const Time asked = bus.poll(now_);
    check_new_sample(bus);
    check_t1();
    const Time due = std::min(asked, port.next_event(now_));
    in_place = due > now_ ? 0 : in_place + 1;
    require(in_place <= 100, "the bus moves on");
    now_ = std::max(now_, due);
  }
  require(waits || recovered(), "the bus recovers");

  const Statistics& s = bus.statistics();
  require(s.cycles == s.good + s.failed, "cycles are good or failed");
  bus.stop();
  require(bus.poll(now_) == kNever, "a stopped bus asks for nothing");
  for (int i = 0; i < 8; ++i)
    if (bus.take_completion()) ++completed_;
  require(offered_ == completed_, "every offer ends in one completion");
  require(!bus.take_completion(), "and in no other");
  return 0;
}

}  // namespace

int fuzz_bus(std::span<const std::uint8_t> bytes) { return Play(bytes).run(); }

}  // namespace tm485::fuzz
