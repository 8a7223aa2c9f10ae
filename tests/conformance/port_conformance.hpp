// The port's contract as checks that every implementation passes (core/include/tm485/bus/port.hpp).
//
// A Rig is a port with everything around it: the far end that hears requests and answers, the line, and time. A check
// is a function that plays one part of the contract on a fresh rig and answers what was violated; a broken twin of a
// port must make it answer something. To put a new port under test, write its rig and instantiate PortConformance.
#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <expected>
#include <functional>
#include <memory>
#include <ostream>
#include <span>
#include <string>
#include <vector>

#include "tm485/bus/port.hpp"
#include "tm485/errc.hpp"
#include "tm485/time.hpp"

namespace tm485::test {

/// What the far end has received. The instants count only where the rig has wire time.
struct HeardByte {
  std::uint8_t byte = 0;
  Time start{0};
  Time end{0};
};

class Rig {
 public:
  Rig() = default;
  Rig(const Rig&) = delete;
  Rig& operator=(const Rig&) = delete;
  virtual ~Rig() = default;

  // The port, called at now().
  [[nodiscard]] virtual PortCapability capability() = 0;
  [[nodiscard]] virtual std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request) = 0;
  [[nodiscard]] virtual Transmission transmission() = 0;
  [[nodiscard]] virtual Reception try_receive(std::span<std::uint8_t> buffer) = 0;

  // Time, virtual or real.
  [[nodiscard]] virtual Time now() = 0;
  /// Lets time pass without a call of the port.
  virtual void pass(Time span) = 0;
  /// How long the owner of the port waits between two calls.
  [[nodiscard]] virtual Time grain() const = 0;
  /// The longest that anything may take; a check that waits longer has found a violation.
  [[nodiscard]] virtual Time patience() const = 0;

  // The far end.
  /// What it has received since the last call.
  [[nodiscard]] virtual std::vector<HeardByte> heard() = 0;
  /// It sends, the first start bit `after` from now; at once where there is no wire time.
  virtual void answer(std::span<const std::uint8_t> bytes, Time after) = 0;
  /// It sends a character without a stop bit. False: it cannot.
  virtual bool answer_broken(std::uint8_t) { return false; }
  /// The device or the other end vanishes. False: it cannot.
  virtual bool vanish() { return false; }

  /// Between two characters of a request. 0, as the contract has it, but for a block whose transmitter holds one character
  /// and no other: its gaps are those between two calls of the owner.
  [[nodiscard]] virtual Time longest_gap() const { return Time{0}; }

  // The line.
  /// The far end knows the instants of the wire, and the line can be looked at.
  [[nodiscard]] virtual bool wire_time() const = 0;
  /// No stop bit is due and the driver is off. Only with wire time.
  [[nodiscard]] virtual bool line_idle() { return true; }
  /// How many characters the receiver holds for a late reader; 0: more than any test has.
  [[nodiscard]] virtual std::size_t receiver_depth() const { return 0; }
  /// What a judge of its own has against the port.
  [[nodiscard]] virtual std::vector<std::string> complaints() { return {}; }
};

using Violations = std::vector<std::string>;

struct Check {
  const char* name;
  Violations (*run)(Rig&);
};

/// All checks.
[[nodiscard]] std::span<const Check> port_checks();
/// One of them, by its name, which must exist.
[[nodiscard]] const Check& port_check(std::string_view name);
/// Runs a check and adds what the rig's own judge has found.
[[nodiscard]] Violations run_check(const Check& check, Rig& rig);

using RigFactory = std::unique_ptr<Rig> (*)();

struct PortUnderTest {
  const char* name;
  RigFactory make;
  friend void PrintTo(const PortUnderTest& port, std::ostream* out) { *out << port.name; }
};

inline void PrintTo(const Check& check, std::ostream* out) { *out << check.name; }

/// INSTANTIATE_TEST_SUITE_P(Ports, PortConformance, conformance_of(PortUnderTest{...}, ...), conformance_name);
using ConformanceCase = std::tuple<PortUnderTest, Check>;
class PortConformance : public testing::TestWithParam<ConformanceCase> {};

[[nodiscard]] inline auto conformance_of(const std::vector<PortUnderTest>& ports) {
  const std::span<const Check> checks = port_checks();
  return testing::Combine(testing::ValuesIn(ports), testing::ValuesIn(checks.begin(), checks.end()));
}

[[nodiscard]] inline std::string conformance_name(const testing::TestParamInfo<ConformanceCase>& info) {
  return std::string(std::get<0>(info.param).name) + "_" + std::get<1>(info.param).name;
}

}  // namespace tm485::test
