// The simulated set-up as one value, and as text: `rpm=3000,profile=tformat_17,seed=7`.
#pragma once

#include <cstdint>
#include <expected>
#include <string>
#include <string_view>

#include "tm485/sim/encoder_model.hpp"
#include "tm485/sim/fault_plan.hpp"
#include "tm485/sim/line.hpp"
#include "tm485/sim/motion_profile.hpp"
#include "tm485/sim/sim_port.hpp"

namespace tm485::sim {

/// Everything that a simulated encoder on its line can be told.
struct SimOptions {
  EncoderConfig encoder;
  MotionProfile motion;
  LineConfig line;
  SimPortConfig port;
  double request_bit_errors = 0.0;  ///< probability of a wrong bit in requests, 0..1
  double reply_bit_errors = 0.0;    ///< probability of a wrong bit in replies, 0..1
  double lost_replies = 0.0;        ///< probability of a reply that does not come, 0..1
  Swap swap = Swap::none;           ///< a pair that is connected the wrong way round
  double glitches = 0.0;            ///< probability of a false start bit before a reply, 0..1
  FaultPlan faults;                 ///< behind wrong bits and lost replies
  bool power = true;                ///< false: the encoder has no supply
  std::uint64_t seed = 1;           ///< of the faults; `seed=` in the text sets every seed
};

/// The whole plan of a set-up: its wrong bits and lost replies first, then its plan.
[[nodiscard]] FaultPlan fault_plan_of(const SimOptions& options);

/// The encoder of a profile name: tm485_17, tm485_23, tformat_17, tformat_23, each also with `_battery`; tm485_17_st
/// (single-turn). A T-format encoder without a battery reports SF 20 and ALMC C1. The error names what is known.
[[nodiscard]] std::expected<EncoderConfig, std::string> encoder_for_profile(std::string_view profile);

/// Reads `key=value` pairs separated by commas, in any order; the empty text is the default set-up. Keys:
///   profile=NAME        kind of encoder, see encoder_for_profile (tm485_17)
///   rpm=R               constant speed; with accel= a trapezoid of this top speed
///   accel=R             rpm per second: back and forth with ramps; cruise=T at the top speed (1s)
///   motion=constant:RPM | sine:REV:HZ | trapezoid:RPM:RPM_PER_S:SECONDS
///   start=REV           angle at time 0, in revolutions
///   turn=N              turn count at power-up
///   seed=N              of everything random
///   enid=HEX sf=HEX almc=HEX   what the encoder reports; without sf= it follows from almc=
///   t2=T or t2=T..T     gap between request and reply; T with ns, us, ms or s
///   latch_offset=T      position taken this long after the request
///   boot=T              silent for this long after power-up
///   echo[=on|off]       the host hears itself
///   jitter=T            requests start up to T late; margin=T states it in the port's capability
///   release=T           the host's driver leaves the line T after the last stop bit
///   baud=N              bits per second of the encoder, and of the host unless its port was opened at another rate
///   ber=P or ber=P:P    probability of a wrong bit, in requests and in replies
///   lost=P              probability of a lost reply
///   plan=FAULTS         a fault plan (FaultPlan::parse), its lines separated by ';'
///   glitch=P            probability of a false start bit on the idle line before a reply
///   swap=pair|receive   A and B swapped, for both ends or for what the host receives
///   power=on|off        off: no supply, so no reply
///   standstill=RPM      ID8 is refused above this speed (0.1)
///   eeprom_pages=N      1..7 (7)
///   eeprom_write=T or T..T     busy after a write (10ms)
///   eeprom_page=T       busy after a page select (18ms; T-format 0ms)
///   eeprom_ack=busy|plain      whether the reply to an accepted write has ADF.7 (plain; T-format busy)
///   eeprom_deaf[=on|off]       position requests stay unanswered while the EEPROM is busy (off)
///   eeprom_volatile=on|off     whether a power cycle selects the page of power-up again (on)
///   eeprom_start=N      page at power-up (0)
///   eeprom_fail=P       probability of a write that leaves the old value
///   eeprom_busy=T       busy for this long from the start
///   eeprom_seed=N       of busy times, failed writes and what a power loss leaves; without it from seed=
/// The error names the key or value that is wrong and what is known instead. May allocate: set-up only.
[[nodiscard]] std::expected<SimOptions, std::string> parse_sim_options(std::string_view text);

}  // namespace tm485::sim
