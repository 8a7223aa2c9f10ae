// A bus on a scripted port with a healthy encoder: the fixture of the bus tests.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <optional>

#include "support/print.hpp"
#include "support/profiles.hpp"
#include "support/scripted_port.hpp"
#include "tm485/bus/bus.hpp"

namespace tm485::test {

/// A bus on a scripted port with a healthy encoder; a test changes what it needs before start().
class BusTest : public testing::Test {
 protected:
  BusTest() {
    port.answer = [this](const Bytes& request, Time start) { return respond(request, start); };
  }

  /// The default: a healthy encoder from `alive_from` on, after what `hook` changes.
  ScriptedPort::Answer respond(const Bytes& request, Time start) {
    ScriptedPort::Answer answer;
    if (start >= alive_from && start < dead_from) answer.bytes = encoder.reply(request);
    if (hook) hook(request, start, answer);
    return answer;
  }

  void make(const char* profile_name = "tm485_17") { make(test::preset(profile_name)); }
  void make(const Profile& p) {
    profile.emplace(test::compiled(p));
    bus.emplace(port, *profile, config);
  }
  void start() { ASSERT_TRUE(bus->start(driver.now)); }
  bool run_until_running(Time limit = ms(3'000)) {
    return driver.run(*bus, port, driver.now + limit, [this] { return bus->state() == BusState::running; });
  }
  bool run_until_failure(Time limit = ms(5'000)) {
    return driver.run(*bus, port, driver.now + limit, [this] { return bus->startup_error().has_value(); });
  }
  void run(Time span) { driver.run(*bus, port, driver.now + span); }
  void run_cycles(std::uint32_t cycles) {
    const std::uint32_t end = bus->statistics().cycles + cycles;
    ASSERT_TRUE(driver.run(*bus, port, driver.now + ms(10'000), [&] {
      return bus->statistics().cycles >= end;
    })) << (driver.stuck ? "the bus asks to be called at once, for ever" : "no cycles");
  }
  void begin_running(const char* profile_name = "tm485_17") {
    make(profile_name);
    start();
    ASSERT_TRUE(run_until_running());
  }
  std::uint32_t errors(Errc code) { return bus->statistics().errors[static_cast<std::size_t>(code)]; }

  /// No two requests closer than T1 of the earlier one, on the whole record.
  void expect_t1_kept() {
    for (std::size_t i = 1; i < port.sent.size(); ++i) {
      const auto request = Request::parse(port.sent[i - 1].bytes);
      ASSERT_TRUE(request);
      ASSERT_GE(port.sent[i].start - port.sent[i - 1].start, profile->t1(*request)) << i;
    }
  }

  PlainEncoder encoder;
  Time alive_from{0};
  Time dead_from = kNever;
  std::function<void(const Bytes&, Time, ScriptedPort::Answer&)> hook;
  ScriptedPort port;
  Driver driver;
  BusConfig config;
  std::optional<CompiledProfile> profile;
  std::optional<Bus<ScriptedPort>> bus;
};

}  // namespace tm485::test
