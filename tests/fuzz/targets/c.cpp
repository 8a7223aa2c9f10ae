// The C interface with settings of any values, a port whose functions answer anything, and calls in any order. Judged:
// what the headers promise of values and bounds; memory and arithmetic by the sanitizers.
#include <algorithm>
#include <array>
#include <cstring>
#include <vector>

#include "fuzz/input.hpp"
#include "fuzz/targets.hpp"
#include "support/frames.hpp"
#include "support/slow_decoder.hpp"
#include "tm485/c/tm485.h"

namespace tm485::fuzz {
namespace {

constexpr test::SlowProfile kAny{"any", 24, false, 0, {}};
constexpr int kMostSteps = 400;

/// The port of a user who has made every mistake.
struct WildPort {
  Input* input;
  std::vector<std::uint8_t> request;
  std::size_t told = 0;  ///< of the reply, how many bytes were handed out
  tm485_port_capability stated{};
};

WildPort& wild(void* context) { return *static_cast<WildPort*>(context); }

void capability(void* context, tm485_port_capability* to) { *to = wild(context).stated; }

tm485_errc try_send(void* context, const std::uint8_t* request, std::size_t count, tm485_time now,
                    tm485_time* start) {
  WildPort& port = wild(context);
  require(count >= 1 && count <= TM485_MAX_REQUEST, "a request has 1 to 4 bytes");
  require(*start == now, "start is now on entry");
  port.request.assign(request, request + count);
  port.told = 0;
  switch (port.input->below(16)) {
    case 0:
      return port.input->u16();
    case 1:
      *start = static_cast<tm485_time>(port.input->u64());
      return TM485_OK;
    case 2:
      *start = now + port.input->u16();
      return TM485_OK;
    default:
      return TM485_OK;
  }
}

tm485_transmission_state transmission(void* context, tm485_time /*now*/, tm485_errc* fault) {
  WildPort& port = wild(context);
  require(*fault == TM485_OK, "fault is TM485_OK on entry");
  if (port.input->below(8) != 0) return TM485_TRANSMISSION_SENT;
  *fault = port.input->u16();
  return port.input->u8();
}

void try_receive(void* context, std::uint8_t* buffer, std::size_t size, tm485_time now,
                 tm485_reception* reception) {
  WildPort& port = wild(context);
  require(reception->count == 0 && reception->fault == TM485_OK, "reception is zero on entry");
  if (port.request.empty()) return;
  reception->first_start = now;
  switch (port.input->below(16)) {
    case 0: {  // anything
      const auto got = port.input->bytes(std::min<std::size_t>(port.input->below(16), size));
      std::ranges::copy(got, buffer);
      reception->count = static_cast<std::uint32_t>(got.size());
      return;
    }
    case 1:
      reception->count = port.input->u32();
      reception->fault = port.input->u16();
      return;
    case 2:
      reception->first_start = static_cast<tm485_time>(port.input->u64());
      break;
    case 3:
      return;
    default:
      break;
  }
  // A good reply, as much of it as fits.
  const test::Kind* kind = std::ranges::find(test::kKinds, port.request[0], &test::Kind::cf);
  if (kind == std::end(test::kKinds)) return;
  std::vector<std::uint8_t> reply;
  switch (kind->id) {
    case 1:
      reply = test::id1_reply(1);
      break;
    case 2:
      reply = test::id2_reply(0x11);
      break;
    case 3:
      reply = test::id3_reply(1'000, 1);
      break;
    case 6:
    case 13:
      reply =
          test::eeprom_reply(kind->cf, port.request[1], kind->id == 6 ? port.request[2] : std::uint8_t{0x5A});
      break;
    default:
      reply = test::short_reply(kind->cf, 1'000);
      break;
  }
  const std::size_t count = std::min(size, reply.size() - std::min(port.told, reply.size()));
  std::copy_n(reply.begin() + static_cast<std::ptrdiff_t>(port.told), count, buffer);
  port.told += count;
  reception->count = static_cast<std::uint32_t>(count);
}

void check_codec(Input& input, const tm485_profile& profile) {
  const auto bytes = input.bytes(input.below(14));
  const tm485_data_id id = input.u8();
  tm485_reply reply;
  std::memset(&reply, 0xA5, sizeof reply);
  const tm485_reply before = reply;
  const tm485_errc code = tm485_reply_parse(&reply, bytes.data(), bytes.size(), id, &profile);
  if (code != TM485_OK) {
    require(std::memcmp(&reply, &before, sizeof reply) == 0, "on an error nothing was written");
  } else {
    const test::SlowReply slow = test::slow_parse(bytes, id, kAny);
    require(slow.error == "ok", "no reply that the slow decoder refuses");
    require(!reply.has_abs || reply.abs == slow.abs, "ABS");
    require(!reply.has_abm || reply.abm == slow.abm, "ABM");
    require(reply.sf == slow.sf && reply.almc == slow.almc && reply.enid == slow.enid, "SF, ALMC, ENID");
    require(reply.eeprom_data == slow.edf, "EDF");
  }
  tm485_request request;
  if (tm485_request_parse(&request, bytes.data(), bytes.size()) == TM485_OK)
    require(request.length == bytes.size() && std::equal(bytes.begin(), bytes.end(), request.bytes),
            "as on the line");
  require(tm485_request_length(id) <= TM485_MAX_REQUEST && tm485_reply_length(id) <= TM485_MAX_REPLY,
          "lengths");
  require(tm485_errc_name(input.u16()) != nullptr && tm485_status_name(input.u8()) != nullptr, "never NULL");
}

/// Overwrites some members' bytes.
template <class T>
void scribble(Input& input, T& object) {
  auto* const bytes = reinterpret_cast<unsigned char*>(&object);
  for (unsigned times = input.below(6); times > 0; --times) {
    const std::size_t at = input.u16() % sizeof object;
    const auto with = input.bytes(std::min<std::size_t>(1U << input.below(4), sizeof object - at));
    std::ranges::copy(with, bytes + at);
  }
}

void scribble_settings(Input& input, tm485_profile_settings& settings) {
  const char* const name = settings.name;
  scribble(input, settings);
  settings.name = name;  // a pointer is the caller's word
}

void check(const tm485_sample& sample) {
  require(sample.quality <= TM485_QUALITY_FRESH && sample.alarm <= TM485_ALARM_FAULT,
          "values of the enumerations");
  require(sample.referenced <= 1 && sample.has_position <= 1, "flags");
}

struct Stage {
  tm485_profile profile;
  tm485_bus bus;
  tm485_axis axis;
  tm485_eeprom eeprom;
  tm485_reset reset;
};

void play_bus(Input& input, Stage& stage, tm485_time now) {
  static constexpr std::uint8_t kWanted[4] = {1, 2, 3, 4};
  std::uint8_t read[16] = {};
  tm485_refusal refusal;
  tm485_feasibility feasibility;
  (void)tm485_bus_check(&stage.bus, &feasibility, &refusal);
  if (tm485_bus_start(&stage.bus, now, &refusal) != TM485_OK) return;
  if (tm485_eeprom_init(&stage.eeprom, &stage.profile, nullptr, nullptr, 0) != TM485_OK) return;
  if (tm485_reset_init(&stage.reset, &stage.profile, nullptr) != TM485_OK) return;
  tm485_time last = now;
  for (int step = 0; step < kMostSteps && !input.empty(); ++step) {
    const tm485_time due = tm485_bus_poll(&stage.bus, now);
    tm485_sample sample;
    tm485_bus_latest(&stage.bus, &sample);
    check(sample);
    tm485_request request{};
    switch (input.below(32)) {
      case 0:
        scribble(input, request);
        (void)tm485_bus_offer(&stage.bus, &request, input.u32());
        break;
      case 1: {
        tm485_completion completion;
        if (tm485_bus_take_completion(&stage.bus, &completion))
          require(completion.error < TM485_ERRC_COUNT && completion.has_reply <= 1, "a completion");
        break;
      }
      case 2:
        tm485_bus_on_restart(&stage.bus, now);
        break;
      case 3:
        tm485_bus_on_servo_tick(&stage.bus, now - input.u32());
        break;
      case 4:
        (void)tm485_eeprom_start_read(&stage.eeprom, input.u16(), read, input.below(20) % (sizeof read + 1));
        break;
      case 5:
        (void)tm485_eeprom_start_write(&stage.eeprom, input.u16(), kWanted, input.below(5));
        break;
      case 6:
        (void)tm485_reset_start(&stage.reset, input.u8());
        break;
      case 7:
        now += input.u32();
        break;
      case 8: {
        tm485_statistics statistics;
        tm485_bus_statistics(&stage.bus, &statistics);
        require(statistics.cycles == statistics.good + statistics.failed, "statistics");
        break;
      }
      default:
        break;
    }
    (void)tm485_eeprom_drive(&stage.eeprom, &stage.bus, now);
    (void)tm485_reset_drive(&stage.reset, &stage.bus, now);
    now += std::clamp<tm485_time>(due - now, 1'000, 1'000'000);
    require(now >= last, "the test's own clock");
    last = now;
  }
  require(tm485_bus_get_state(&stage.bus) <= TM485_STATE_RUNNING, "a state");
  tm485_bus_stop(&stage.bus);
  require(tm485_bus_poll(&stage.bus, now) == TM485_NEVER, "a stopped bus asks for nothing");
}

void play_axis(Input& input, Stage& stage, const tm485_port& port, const tm485_bus_config& config) {
  tm485_axis_setup setup;
  tm485_axis_setup_default(&setup);
  setup.bus = config;
  setup.statistics_every = static_cast<tm485_time>(input.u64());
  if (tm485_axis_init(&stage.axis, &port, &stage.profile, &setup) != TM485_OK) return;
  tm485_refusal refusal;
  tm485_time now = 0;
  if (tm485_axis_start(&stage.axis, now, &refusal) != TM485_OK) return;
  for (int step = 0; step < kMostSteps && !input.empty(); ++step) {
    const tm485_time due = tm485_axis_poll(&stage.axis, now);
    tm485_sample sample;
    require(tm485_loop_read(&stage.axis, now, &sample) <= TM485_VALIDITY_FRESH, "validity");
    check(sample);
    tm485_request request{};
    if (input.below(8) == 0) {
      scribble(input, request);
      (void)tm485_loop_post(&stage.axis,
                            input.below(8) == 0 ? input.u8() : static_cast<tm485_command>(input.below(5)),
                            &request, nullptr);
    }
    tm485_command_result result;
    if (tm485_loop_poll_completion(&stage.axis, &result))
      require(result.error < TM485_ERRC_COUNT, "a result");
    now += std::clamp<tm485_time>(due - now, 1'000, 1'000'000);
  }
  tm485_axis_stop(&stage.axis, now);
}

}  // namespace

int fuzz_c(std::span<const std::uint8_t> bytes) {
  Input input(bytes);
  static Stage stage;
  tm485_profile_settings settings;
  const char* const preset = tm485_preset_name(input.u8() % tm485_preset_count());
  if (tm485_profile_settings_get(&settings, preset) != TM485_OK) return 0;
  scribble_settings(input, settings);
  tm485_profile_error why;
  if (tm485_profile_compile(&stage.profile, &settings, &why) != TM485_OK) {
    require(why.field[0] != '\0' && why.why[0] != '\0', "a refusal says why");
    require(tm485_profile_init(&stage.profile, preset) == TM485_OK, "presets compile");
  }
  check_codec(input, stage.profile);
  WildPort wild_port{.input = &input, .request = {}, .told = 0, .stated = {}};
  scribble(input, wild_port.stated);
  tm485_bus_config config;
  tm485_bus_config_default(&config);
  scribble(input, config);
  const tm485_port port{&wild_port, capability, try_send, transmission, try_receive};
  if (input.flag()) {
    play_axis(input, stage, port, config);
  } else if (tm485_bus_init(&stage.bus, &port, &stage.profile, &config) == TM485_OK) {
    play_bus(input, stage, 0);
  }
  return 0;
}

}  // namespace tm485::fuzz
