// Axis and its client: what the loop is told, commands and their completions, statistics.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <memory>
#include <utility>

#include "support/frames.hpp"
#include "support/print.hpp"
#include "support/profiles.hpp"
#include "support/scripted_port.hpp"
#include "tm485/bus/axis.hpp"

namespace tm485 {
namespace {

using test::Bytes;
using test::error_of;
using test::ms;
using test::ns;
using test::ScriptedPort;
using test::us;

/// Two states; as solved for 1 kHz at 16 kHz, here over a longer period.
constexpr EstimatorGains kGains = [] {
  EstimatorGains gains;
  gains.period = us(110);
  gains.order = 2;
  gains.gain = {0.424100041F, 0.115544081F, 0.0F};
  gains.covariance = {.pp = 0.0353416689F, .pv = 0.00962867402F, .vv = 0.00612476654F};
  gains.process_noise = 0.00193182216F;
  gains.measurement_variance = 1.0F / 12.0F;
  return gains;
}();
static_assert(valid(kGains));

class AxisTest : public testing::Test {
 protected:
  AxisTest() {
    setup.bus.cycle = Cycle{DataId::everything, us(110)};
    setup.bus.max_hold = ms(1);
    setup.on_invalid = {[](void* self, Time now) {
                          auto* test = static_cast<AxisTest*>(self);
                          ++test->torque_offs;
                          test->torque_off_at = now;
                        },
                        this};
    port.answer = [this](const Bytes& request, Time start) {
      ScriptedPort::Answer answer;
      encoder.abs = static_cast<std::uint32_t>((start + us(4)).count() * counts_per_ms / 1'000'000) & 0x1FFFF;
      if (alive && start >= deaf_until) answer.bytes = encoder.reply(request);
      return answer;
    };
  }

  void make(const char* name = "tm485_17") {
    profile = std::make_unique<CompiledProfile>(test::compiled(name));
    axis = std::make_unique<Axis<ScriptedPort>>(port, *profile, setup);
  }
  template <class Done>
  bool run(Time span, Done done) {
    return driver.run(*axis, port, driver.now + span, done);
  }
  void run(Time span) {
    driver.run(*axis, port, driver.now + span);
    driver.now = std::max(driver.now, Time{0});
  }
  void begin_running(const char* name = "tm485_17") {
    make(name);
    ASSERT_TRUE(axis->start(driver.now));
    ASSERT_TRUE(run(ms(3'000), [&] { return read().validity == SampleValidity::fresh; }));
  }
  LoopState read() { return axis->client().read(driver.now); }
  AxisClient& client() { return axis->client(); }
  /// Runs until the command is completed.
  CommandResult result_of(const Command& command, Time limit = ms(50)) {
    const auto ticket = client().post(command);
    EXPECT_TRUE(ticket);
    std::optional<CommandResult> result;
    // The bus's context looks at the ring whenever it is polled: here every cycle.
    EXPECT_TRUE(run(limit, [&] { return (result = client().poll_completion()).has_value(); }));
    if (!result) return {};
    EXPECT_EQ(result->ticket, *ticket);
    return *result;
  }

  test::PlainEncoder encoder;
  std::int64_t counts_per_ms = 0;
  bool alive = true;
  Time deaf_until{0};
  int torque_offs = 0;
  Time torque_off_at{0};
  ScriptedPort port;
  test::Driver driver;
  AxisSetup setup;
  std::unique_ptr<CompiledProfile> profile;
  std::unique_ptr<Axis<ScriptedPort>> axis;
};

TEST_F(AxisTest, BeforeTheFirstSampleNothingIsValidAndNobodyIsCalled) {
  make();
  EXPECT_EQ(read().validity, SampleValidity::invalid);
  EXPECT_FALSE(read().sample->has_position());
  const AxisView& nothing = client().view();
  EXPECT_FALSE(nothing.valid || nothing.newest || nothing.latched)
      << "latched: of a loss, and there was none";
  EXPECT_EQ(nothing.state, BusState::stopped);
  EXPECT_EQ(nothing.link, LinkState::lost);
  EXPECT_EQ(nothing.alarm, AlarmLevel::none);
  EXPECT_EQ(nothing.startup_cause, Errc::ok);
  ASSERT_TRUE(axis->start(driver.now));
  (void)read();
  EXPECT_EQ(client().view().state, BusState::startup) << "before anybody polls";
  run(us(200));
  EXPECT_EQ(read().validity, SampleValidity::invalid);
  EXPECT_EQ(client().view().state, BusState::startup);
  EXPECT_EQ(torque_offs, 0);
}

TEST_F(AxisTest, WhyStartUpDoesNotEndIsInTheView) {
  alive = false;
  make();
  ASSERT_TRUE(axis->start(driver.now));
  run(ms(3'000));
  (void)read();
  EXPECT_EQ(client().view().startup_cause, Errc::timeout);
  alive = true;
  ASSERT_TRUE(run(ms(3'000), [&] { return read().validity == SampleValidity::fresh; }));
  EXPECT_EQ(client().view().startup_cause, Errc::ok);
}

TEST_F(AxisTest, FreshThenExtrapolatedThenInvalid) {
  begin_running();
  const Time latch = read().sample->latch_time();
  alive = false;
  bool extrapolated = false;
  Time first_invalid = kNever;
  ASSERT_TRUE(run(ms(10), [&] {
    const LoopState state = read();
    const Time age = driver.now - latch;
    if (state.validity == SampleValidity::fresh) {
      EXPECT_LE(age, us(200)) << "older than its successor would be";
      EXPECT_FALSE(extrapolated) << "not fresh again";
    }
    if (state.validity == SampleValidity::extrapolated) extrapolated = true;
    if (state.validity == SampleValidity::invalid && first_invalid == kNever) first_invalid = driver.now;
    return first_invalid != kNever;
  }));
  EXPECT_TRUE(extrapolated);
  EXPECT_GE(first_invalid - latch, ms(1));
  EXPECT_LE(first_invalid - latch, ms(1) + us(250));
  EXPECT_EQ(torque_offs, 1);
  EXPECT_LE(torque_off_at - latch, ms(1) + us(250));
}

TEST_F(AxisTest, InvalidIsLatchedUntilTheCommandAndRaisedOnce) {
  begin_running();
  alive = false;
  run(ms(2));
  EXPECT_EQ(torque_offs, 1);
  EXPECT_EQ(result_of(Command::of(Command::Kind::resume)).error, Errc::bad_state) << "nothing fresh comes";
  alive = true;
  run(ms(2'000));
  EXPECT_EQ(axis->bus().latest().quality(), Quality::fresh) << "the bus is well again";
  EXPECT_EQ(read().validity, SampleValidity::invalid) << "the loop is not told so";
  EXPECT_TRUE(client().view().latched);
  EXPECT_EQ(torque_offs, 1);
  EXPECT_EQ(result_of(Command::of(Command::Kind::resume)).error, Errc::ok);
  EXPECT_EQ(read().validity, SampleValidity::fresh);
  alive = false;
  run(ms(2));
  EXPECT_EQ(torque_offs, 2) << "once each time";
}

TEST_F(AxisTest, ABusThatIsNotPolledIsFoundOutByTheReader) {
  begin_running();
  const LoopState before = read();
  ASSERT_EQ(before.validity, SampleValidity::fresh);
  driver.now += us(300);
  EXPECT_EQ(read().validity, SampleValidity::extrapolated);
  driver.now += ms(1);
  EXPECT_EQ(read().validity, SampleValidity::invalid);
  driver.now -= us(1'200);
  EXPECT_EQ(read().validity, SampleValidity::invalid) << "latched on this side";
  driver.now += us(1'200);
  run(ms(500));
  EXPECT_EQ(read().validity, SampleValidity::invalid);
  EXPECT_EQ(torque_offs, 1) << "the bus's context found it when it came back";
  EXPECT_EQ(result_of(Command::of(Command::Kind::resume)).error, Errc::ok);
  EXPECT_EQ(read().validity, SampleValidity::fresh);
}

// The bus's context stalls for so short a time that it does not notice, but the reader's clock did.
TEST_F(AxisTest, AReaderThatSawSilenceStaysInvalidThoughTheBusNeverDid) {
  begin_running();
  (void)read();
  const Time later = driver.now + ms(5);
  EXPECT_EQ(client().read(later).validity, SampleValidity::invalid);
  run(us(500));
  EXPECT_FALSE(client().view().latched);
  EXPECT_EQ(read().validity, SampleValidity::invalid);
  EXPECT_EQ(result_of(Command::of(Command::Kind::resume)).error, Errc::ok);
  EXPECT_EQ(read().validity, SampleValidity::fresh);
  // The command of last time does not count for the next.
  EXPECT_EQ(client().read(driver.now + ms(5)).validity, SampleValidity::invalid);
  run(us(500));
  EXPECT_EQ(read().validity, SampleValidity::invalid);
  EXPECT_EQ(result_of(Command::of(Command::Kind::resume)).error, Errc::ok);
  EXPECT_EQ(read().validity, SampleValidity::fresh);
}

TEST_F(AxisTest, StopMakesInvalidAndAnswersWhatWaits) {
  begin_running();
  for (unsigned i = 0; i < 5; ++i) ASSERT_TRUE(client().post(Command::exchange(*Request::eeprom_read(i))));
  axis->stop(driver.now);
  EXPECT_EQ(read().validity, SampleValidity::invalid);
  EXPECT_EQ(torque_offs, 1);
  for (int i = 0; i < 5; ++i) {
    const auto result = client().poll_completion();
    ASSERT_TRUE(result);
    EXPECT_EQ(result->error, Errc::bad_state);
  }
  EXPECT_FALSE(client().poll_completion());
}

TEST_F(AxisTest, AnExchangeComesBackWithItsReply) {
  begin_running();
  const CommandResult result = result_of(Command::exchange(*Request::eeprom_read(9)));
  EXPECT_EQ(result.error, Errc::ok);
  ASSERT_TRUE(result.reply);
  EXPECT_EQ(result.reply->frame().edf(), 0x5A);
  EXPECT_EQ(result.command.request.address(), 9U);
}

TEST_F(AxisTest, RefusalsComeBackToo) {
  make();
  EXPECT_EQ(result_of(Command::of(Command::Kind::restart)).error, Errc::bad_state) << "it was never started";
  EXPECT_EQ(result_of(Command::exchange(*Request::eeprom_read(9))).error, Errc::bad_state);
  setup.bus.cycle = Cycle{};
  begin_running();
  const CommandResult result = result_of(Command::exchange(*Request::eeprom_read(9)));
  EXPECT_EQ(result.error, Errc::no_gap);
  EXPECT_FALSE(result.reply);
}

TEST_F(AxisTest, AnExchangeWaitsForOneOfTheBussOwnUser) {
  begin_running();
  ASSERT_TRUE(axis->bus().offer(*Request::eeprom_read(8), 77));
  const auto ticket = client().post(Command::exchange(*Request::eeprom_read(9)));
  ASSERT_TRUE(ticket);
  run(ms(5));
  EXPECT_FALSE(client().poll_completion()) << "nobody has taken the other's completion";
  EXPECT_EQ(std::as_const(*axis).bus().state(), BusState::running);
  const auto other = axis->bus().take_completion(Priority::eeprom, 77);
  ASSERT_TRUE(other);
  EXPECT_EQ(other->request.address(), 8U);
  std::optional<CommandResult> result;
  EXPECT_TRUE(run(ms(5), [&] { return (result = client().poll_completion()).has_value(); }));
  ASSERT_TRUE(result);
  EXPECT_EQ(result->ticket, *ticket);
  EXPECT_EQ(result->error, Errc::ok);
}

TEST_F(AxisTest, NoMoreCommandsThanThereIsRoomForTheirResults) {
  begin_running();
  for (std::uint32_t i = 0; i < kAxisCommands; ++i)
    ASSERT_TRUE(client().post(Command::of(Command::Kind::set_referenced)));
  EXPECT_EQ(error_of(client().post(Command::of(Command::Kind::set_referenced))), Errc::busy);
  run(ms(1));
  EXPECT_EQ(error_of(client().post(Command::of(Command::Kind::set_referenced))), Errc::busy)
      << "until a result was taken";
  ASSERT_TRUE(client().poll_completion());
  EXPECT_TRUE(client().post(Command::of(Command::Kind::set_referenced)));
}

TEST_F(AxisTest, EveryCommandCompletesExactlyOnceWhateverHappens) {
  setup.bus.lost_after = ms(1);
  setup.bus.max_hold = ms(5);
  begin_running();
  test::Rng rng(90);
  std::map<std::uint32_t, int> open;
  std::uint32_t posted = 0;
  std::map<Errc, int> outcomes;
  const auto take = [&] {
    while (const auto result = client().poll_completion()) {
      ASSERT_EQ(open.erase(result->ticket), 1U) << "ticket " << result->ticket << " twice, or never posted";
      ++outcomes[result->error];
    }
  };
  for (int i = 0; i < 20'000; ++i) {
    alive = test::random_below(rng, 40) != 0 && driver.now >= deaf_until;
    if (test::random_below(rng, 2'000) == 0) deaf_until = driver.now + ms(3);
    Command command;
    switch (test::random_below(rng, 12)) {
      case 0:
        command = Command::of(Command::Kind::resume);
        break;
      case 1:
        command = Command::of(Command::Kind::unreference);
        break;
      case 2:
        command = test::random_below(rng, 100) == 0 ? Command::of(Command::Kind::restart)
                                                    : Command::exchange(*Request::make(DataId::reset_errors));
        break;
      case 3:
      case 4:
        command = Command::exchange(*Request::make(DataId::encoder_id));
        break;
      default:
        command = Command::exchange(*Request::eeprom_read(i & 127));
        break;
    }
    if (const auto ticket = client().post(command)) {
      open[*ticket] = 1;
      ++posted;
    }
    run(us(static_cast<int>(test::random_below(rng, 400))));
    if (test::random_below(rng, 3) == 0) take();
    if (HasFatalFailure()) return;
  }
  alive = true;
  run(ms(100));
  take();
  run(ms(100));
  take();
  EXPECT_TRUE(open.empty()) << open.size() << " commands never completed";
  EXPECT_GT(posted, 10'000U);
  EXPECT_GT(outcomes[Errc::ok], 1'000);
  EXPECT_GT(outcomes[Errc::timeout], 10);
  EXPECT_GT(outcomes[Errc::bad_state], 10);
}

TEST_F(AxisTest, ReferencedByCommandAndLostWithARestart) {
  begin_running();
  EXPECT_FALSE(read().sample->referenced());
  EXPECT_EQ(result_of(Command::of(Command::Kind::set_referenced)).error, Errc::ok);
  run(us(300));
  EXPECT_TRUE(read().sample->referenced());
  EXPECT_EQ(result_of(Command::of(Command::Kind::restart)).error, Errc::ok);
  EXPECT_EQ(read().validity, SampleValidity::invalid);
  EXPECT_EQ(torque_offs, 1);
  ASSERT_TRUE(run(ms(3'000), [&] { return axis->bus().latest().quality() == Quality::fresh; }));
  EXPECT_FALSE(axis->bus().latest().referenced()) << "no battery: the turns are gone";
}

TEST_F(AxisTest, ABatteryKeepsTheReferenceOverARestart) {
  encoder.enid = 0x11;
  begin_running("tm485_17_battery");
  EXPECT_TRUE(read().sample->referenced());
  EXPECT_EQ(result_of(Command::of(Command::Kind::restart)).error, Errc::ok);
  ASSERT_TRUE(run(ms(3'000), [&] { return axis->bus().latest().quality() == Quality::fresh; }));
  EXPECT_TRUE(axis->bus().latest().referenced());
}

TEST_F(AxisTest, TheEstimateFollowsTheShaftAndSurvivesMissingSamples) {
  setup.gains = &kGains;
  counts_per_ms = 1'000;  // 458 rpm
  begin_running();
  run(ms(20));
  read();
  const Estimate now = client().estimate_at(driver.now);
  ASSERT_TRUE(now.valid());
  EXPECT_NEAR(now.velocity, 1e6F, 2e3F);
  const double ahead = client().estimate_at(driver.now + us(100)).position_from(now.position) - now.fraction;
  EXPECT_NEAR(ahead, 100.0, 1.0);
  alive = false;
  run(us(400));
  EXPECT_EQ(read().validity, SampleValidity::extrapolated);
  EXPECT_EQ(client().estimate_at(driver.now).state, EstimatorState::bridging);
  EXPECT_GT(client().estimate_at(driver.now).position_variance, now.position_variance);
}

TEST_F(AxisTest, WithoutGainsTheEstimateIsEmpty) {
  begin_running();
  EXPECT_FALSE(client().estimate_at(driver.now).valid());
  EXPECT_EQ(client().estimate_at(us(5)).time, us(5));
}

TEST_F(AxisTest, StatisticsAreReadElsewhereAndNoOlderThanStated) {
  begin_running();
  setup.statistics_every = ms(1);
  run(ms(50));
  Statistics seen;
  ASSERT_TRUE(client().statistics(seen));
  const std::uint32_t cycles = axis->bus().statistics().cycles;
  EXPECT_GT(cycles, 400U);
  EXPECT_LE(cycles - seen.cycles, 11U) << "a millisecond's worth";
}

TEST_F(AxisTest, ServoTicksThroughTheLink) {
  setup.bus.phase = Phase::locked_to({us(110), us(60)});
  begin_running();
  Time tick = driver.now + us(37);
  for (int i = 0; i < 1'000; ++i) {
    run(tick - driver.now, [] { return false; });
    driver.now = tick;
    client().servo_tick(tick);
    const auto lead = static_cast<double>((tick - read().sample->latch_time()).count());
    ASSERT_TRUE(i <= 300 || std::abs(lead - 60'000.0) <= 5.0) << lead;
    tick += us(110);
  }
  EXPECT_EQ(axis->bus().statistics().servo_locks, 1U);
  EXPECT_GE(axis->bus().statistics().servo_ticks, 999U);
  EXPECT_LE(axis->bus().statistics().servo_ticks, 1'000U) << "each once";
}

}  // namespace
}  // namespace tm485
