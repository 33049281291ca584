// Injected faults, cycle by cycle: what each does to readings and commands, and when.
#include "injection/injecting_driver.hpp"

#include <cmath>

#include "catch.hpp"
#include "rig/encoder_scale.hpp"

using namespace abs_hil;
using namespace abs_hil::config;
using namespace abs_hil::driver;
using namespace abs_hil::injection;

namespace {

constexpr std::int64_t ms = 1'000'000;

/// Both wheels turn by 100 and 120 counts a ms, and what is written is kept.
class TurningRig final : public RigDriver {
 public:
  ~TurningRig() override { static_cast<void>(deactivate()); }
  [[nodiscard]] std::string_view name() const noexcept override { return "turning"; }
  rig::Command last{};
  int made_safe{0};

 private:
  void do_configure() override {}
  void do_activate(std::int64_t) override {}
  IoResult do_read(std::int64_t now_ns, rig::Measurement& m) noexcept override {
    m = {};
    m.time_ns = now_ns;
    m.upper_counts = static_cast<std::int32_t>(now_ns / ms * 100);
    m.lower_counts = static_cast<std::int32_t>(now_ns / ms * 120);
    m.supply_V = 24.0 + static_cast<double>(now_ns / ms);
    m.temperature_C = 30.0;
    return {};
  }
  IoResult do_write(const rig::Command& command, rig::Command& sent) noexcept override {
    sent = as_sent(command);
    last = command;
    return {};
  }
  IoResult do_make_safe() noexcept override {
    ++made_safe;
    last = {};
    return {};
  }
};

/// A rig with faults, cycle by cycle at 1 kHz.
struct Bench {
  explicit Bench(std::string_view faults, std::uint64_t seed = 1)
      : driver(std::make_unique<TurningRig>(), parse_injections(faults), seed,
               [this](std::int64_t duration_ns) { passed_ns += duration_ns; }),
        rig(dynamic_cast<const TurningRig&>(driver.inner())) {
    driver.configure();
    driver.activate(0);
  }
  /// One cycle; the measurement, unless the call failed.
  /// True if the rig answered.
  bool cycle(rig::Phase phase = rig::Phase::brake, const rig::Command& command = {}) {
    time_ns += ms;
    read = driver.read(time_ns, measurement);
    driver.note_phase(phase);
    written = driver.write(command);
    return read.ok();
  }
  void cycles(int count, rig::Phase phase = rig::Phase::brake) {
    for (int i = 0; i < count; ++i) REQUIRE(cycle(phase));
  }
  std::int64_t passed_ns{0};
  InjectingDriver driver;
  const TurningRig& rig;
  std::int64_t time_ns{0};
  rig::Measurement measurement{};
  IoResult read{};
  IoResult written{};
};

}  // namespace

TEST_CASE("a fault begins with its phase and delay, and ends with its duration") {
  Bench bench("brake@encoder_upper:stuck+2ms~3ms");
  bench.cycles(3, rig::Phase::coast);
  CHECK(bench.measurement.upper_counts == 300);
  bench.cycles(2);  // the phase is entered in the cycle at 4 ms; the fault begins at 6 ms
  CHECK(bench.measurement.upper_counts == 500);
  CHECK(bench.driver.first_effect_ns() == -1);
  bench.cycles(1);
  CHECK(bench.driver.first_effect_ns() == 6 * ms);
  bench.cycles(2);  // 6, 7, 8 ms: stuck
  CHECK(bench.measurement.upper_counts == 500);
  CHECK(bench.measurement.lower_counts == 960);
  bench.cycles(1, rig::Phase::hold);
  CHECK(bench.measurement.upper_counts == 600);  // the counts lost are lost for good
}

TEST_CASE("a fault that never began is told after the run") {
  Bench bench("coast@encoder_upper:stuck, brake@encoder_upper:stuck+1s, brake@encoder_lower:stuck");
  REQUIRE(bench.cycle());
  const auto told = bench.driver.tally();
  REQUIRE(told.size() == 2);
  CHECK_THAT(told[0], Catch::Matchers::Contains("coast@encoder_upper:stuck never began"));
  CHECK_THAT(told[1], Catch::Matchers::Contains("+1s never began"));
}

TEST_CASE("encoders: the effect of each kind on the counts") {
  const auto upper_after = [](std::string_view fault, int cycles) {
    Bench bench(std::string("any@encoder_upper:") + std::string(fault) + "+11ms");
    bench.cycles(10);  // 1000 counts
    bench.cycles(cycles);
    return bench.measurement.upper_counts;
  };
  CHECK(upper_after("ok", 5) == 1500);
  CHECK(upper_after("off", 5) == 0);
  CHECK(upper_after("stuck", 5) == 1000);
  CHECK(upper_after("wrong", 5) == 500);
  CHECK(upper_after("wrong=1.0078125", 5) == 1503);  // 3.9 counts too many so far: the fraction is kept
  CHECK(upper_after("wrong=1.0078125", 6) == 1604);
  CHECK(upper_after("slow=3ms", 2) == 1000);
  CHECK(upper_after("slow=3ms", 3) == 1300);
  CHECK(upper_after("slow=3ms", 5) == 1300);
  CHECK(upper_after("slow=3ms", 6) == 1600);
  CHECK(upper_after("delayed=3ms", 3) == 1000);
  CHECK(upper_after("delayed=3ms", 5) == 1200);
  const auto lost = upper_after("intermittent=0.25", 4000);
  CHECK(lost == Approx(1000 + 300'000).epsilon(0.05));
  CHECK(lost % 100 == 0);
  CHECK(upper_after("garbage", 2) != upper_after("garbage", 3));
}

TEST_CASE("both encoders: swapped, or failing alike") {
  Bench swapped("any@encoders:wrong");
  swapped.cycles(1);
  swapped.cycles(4);
  CHECK(swapped.measurement.upper_counts == 100 + 4 * 120);
  CHECK(swapped.measurement.lower_counts == 120 + 4 * 100);
  Bench lost("any@encoders:stuck");
  lost.cycles(5);
  CHECK(lost.measurement.upper_counts == 100);
  CHECK(lost.measurement.lower_counts == 120);
}

TEST_CASE("after the end of a delay no counts are missing") {
  Bench bench("any@encoder_upper:delayed=4ms+5ms~10ms,any@encoder_lower:slow=4ms+5ms~10ms");
  bench.cycles(30);
  CHECK(bench.measurement.upper_counts == 3000);
  CHECK(bench.measurement.lower_counts == 3600);
}

TEST_CASE("supply, temperature, trip flags and stamp fail like numbers") {
  const auto after = [](std::string_view fault) {
    Bench bench(std::string(fault) + "+3ms");
    bench.cycles(6);
    return bench.measurement;
  };
  CHECK(after("any@supply:off").supply_V == 0.0);
  CHECK(after("any@supply:wrong").supply_V == 15.0);
  CHECK(after("any@supply:stuck").supply_V == 26.0);
  CHECK(after("any@supply:slow=2ms").supply_V == 30.0 - 0.0);  // renewed at 4 and 6 ms
  CHECK(after("any@supply:delayed=2ms").supply_V == 28.0);
  CHECK(std::isnan(after("any@temperature:off").temperature_C));
  CHECK(after("any@temperature:wrong").temperature_C == 130.0);
  CHECK(after("any@trip:wrong").trip_flags == 7);
  CHECK(after("any@trip:off").trip_flags == 0);
  CHECK(after("any@stamp:stuck").time_ns == 2 * ms);
  CHECK(after("any@stamp:off").time_ns == 0);
  CHECK(after("any@stamp:wrong").time_ns == 12 * ms);
}

TEST_CASE("whole answers") {
  Bench off("any@read:off+2ms");
  off.cycles(1);
  CHECK_FALSE(off.cycle());
  CHECK(off.read.error == IoError::no_answer);
  Bench wrong("any@read:wrong+2ms");
  wrong.cycles(1);
  CHECK_FALSE(wrong.cycle());
  CHECK(wrong.read.error == IoError::implausible_answer);
  Bench stuck("any@read:stuck+3ms");
  stuck.cycles(5);
  CHECK(stuck.measurement.time_ns == 2 * ms);
  CHECK(stuck.measurement.lower_counts == 240);
  Bench delayed("any@read:delayed=3ms+3ms");
  delayed.cycles(8);
  CHECK(delayed.measurement.time_ns == 5 * ms);
  Bench slow("any@read:slow=3ms");
  slow.cycles(2);
  CHECK(slow.passed_ns == 6 * ms);
  Bench intermittent("any@read:intermittent=0.3");
  int failed = 0;
  for (int i = 0; i < 1000; ++i) failed += intermittent.cycle() ? 0 : 1;
  CHECK(failed == Approx(300).margin(60));
}

TEST_CASE("commands: the effect of each kind") {
  const rig::Command driving{.motor_duty = 0.8, .motor_enable = true};
  const rig::Command braking{.brake_duty = 0.6, .brake_torque_Nm = 3.0};
  const auto sent = [](std::string_view fault, const rig::Command& command) {
    Bench bench(fault);
    for (int i = 0; i < 4; ++i) bench.cycle(rig::Phase::brake, command);
    REQUIRE(bench.written.ok());
    return bench.rig.last;
  };
  CHECK(sent("any@motor_pwm:off", driving).motor_duty == 0.0);
  CHECK(sent("any@motor_pwm:wrong", driving).motor_duty == 0.4);
  CHECK(sent("any@motor_pwm:wrong=5", driving).motor_duty == 1.0);
  CHECK(sent("any@brake_pwm:off", braking).brake_duty == 0.0);
  CHECK(sent("any@brake_pwm:off", braking).brake_torque_Nm == 0.0);
  CHECK(sent("any@brake_pwm:stuck+3ms", braking).brake_duty == 0.6);
  CHECK_FALSE(sent("any@enable:off", driving).motor_enable);
  CHECK(sent("any@enable:wrong", braking).motor_enable);
  CHECK(sent("any@write:wrong", driving).motor_duty == 0.4);
  CHECK(sent("any@write:stuck", driving).motor_duty == 0.0);  // from the first on: nothing was ever sent
  CHECK(sent("any@write:delayed=2ms", driving).motor_duty == 0.8);
  CHECK(sent("any@write:delayed=4ms", driving).motor_duty == 0.0);
  for (int seed = 1; seed < 20; ++seed) {
    Bench bench("any@write:garbage", static_cast<std::uint64_t>(seed));
    bench.cycle(rig::Phase::brake, braking);
    REQUIRE(bench.written.ok());
    CHECK(bench.rig.last.brake_duty >= 0.0);
    CHECK(bench.rig.last.brake_duty < 1.0);
  }
}

TEST_CASE("a write that fails makes the rig safe, and so does every end") {
  Bench bench("any@write:off+3ms");
  bench.cycles(2);
  const int before = bench.rig.made_safe;
  bench.cycle(rig::Phase::brake, {.brake_duty = 0.5});
  CHECK(bench.written.error == IoError::no_answer);
  CHECK(bench.rig.made_safe == before + 1);
  CHECK(bench.driver.state() == DriverState::failed);
  Bench stuck("any@write:stuck+2ms");
  stuck.cycle(rig::Phase::accelerate, {.motor_duty = 1.0, .motor_enable = true});
  stuck.cycle(rig::Phase::stopped, {});
  CHECK(stuck.rig.last.motor_duty == 1.0);
  CHECK(stuck.driver.deactivate().ok());
  CHECK(stuck.rig.last.motor_duty == 0.0);
}

TEST_CASE("the same seed gives the same faults, another seed other ones") {
  const auto history = [](std::uint64_t seed) {
    Bench bench("any@encoder_upper:intermittent,any@supply:garbage", seed);
    std::vector<double> values;
    for (int i = 0; i < 50; ++i) {
      bench.cycle();
      values.push_back(bench.measurement.upper_counts + bench.measurement.supply_V);
    }
    return values;
  };
  CHECK(history(7) == history(7));
  CHECK(history(7) != history(8));
}

TEST_CASE("the later fault acts, and ok heals") {
  Bench bench("any@supply:off+2ms,any@supply:ok+4ms");
  bench.cycles(3);
  CHECK(bench.measurement.supply_V == 0.0);
  bench.cycles(2);
  CHECK(bench.measurement.supply_V == 29.0);
}

TEST_CASE("a fault of both encoders and one of either end each other") {
  Bench healed("any@encoders:stuck,any@encoder_upper:ok+3ms,any@encoder_lower:wrong+3ms");
  healed.cycles(2);
  CHECK(healed.measurement.upper_counts == 100);
  healed.cycles(5);
  CHECK(healed.measurement.upper_counts == 100 + 5 * 100);
  CHECK(healed.measurement.lower_counts == 120 - 5 * 120);
  Bench later("any@encoder_upper:wrong,any@encoders:ok+3ms");
  later.cycles(7);
  CHECK(later.measurement.upper_counts == 100 - 1 * 100 + 5 * 100);
  Bench half_swapped("any@encoders:wrong,any@encoder_lower:ok+3ms");
  half_swapped.cycles(7);
  CHECK(half_swapped.measurement.upper_counts == 100 + 6 * 120);
  CHECK(half_swapped.measurement.lower_counts == 120 + 1 * 100 + 5 * 120);
}

TEST_CASE("a repeated delay begins with the current value") {
  Bench supply("any@supply:delayed=2ms+2ms~3ms,any@supply:delayed=2ms+10ms");
  supply.cycles(10);
  CHECK(supply.measurement.supply_V == 33.0);  // of the ninth, the last without it
  Bench answer("any@read:delayed=2ms+2ms~3ms,any@read:delayed=2ms+10ms");
  answer.cycles(10);
  CHECK(answer.measurement.time_ns == 9 * ms);
  Bench command("any@write:delayed=2ms+2ms~3ms,any@write:delayed=2ms+10ms");
  for (int i = 1; i <= 10; ++i) command.cycle(rig::Phase::brake, {.brake_duty = 0.01 * i});
  CHECK(command.rig.last.brake_duty == Approx(0.09));
}

TEST_CASE("a run's faults do not depend on the previous run") {
  Bench bench("any@write:delayed=4ms,any@encoder_upper:delayed=4ms,any@supply:delayed=4ms");
  for (int i = 0; i < 3; ++i) bench.cycle(rig::Phase::accelerate, {.motor_duty = 0.8, .motor_enable = true});
  REQUIRE(bench.driver.deactivate().ok());
  bench.driver.activate(bench.time_ns);
  for (int i = 0; i < 3; ++i) {
    bench.cycle();
    CHECK(bench.rig.last.motor_duty == 0.0);
    CHECK(bench.measurement.upper_counts == 400);
    CHECK(bench.measurement.supply_V == 0.0);
  }
}

TEST_CASE("a duration longer than any run means no end") {
  Bench bench("any@supply:off~1e30s");
  bench.cycles(3);
  CHECK(bench.measurement.supply_V == 0.0);
}

TEST_CASE("A fault of the outputs lies behind the driver: it tells the command that would have gone out") {
  for (const char* fault : {"any@brake_pwm:off", "any@brake_pwm:wrong=0.5", "any@write:stuck"}) {
    Bench bench(fault);
    CAPTURE(fault);
    rig::Command sent;
    REQUIRE(bench.cycle());
    REQUIRE(bench.driver.write({.brake_duty = 0.6, .brake_torque_Nm = 3.0}, sent).ok());
    CHECK(bench.rig.last.brake_duty < 0.5);
    CHECK(sent.brake_duty == 0.6);
    CHECK(sent.brake_torque_Nm == 3.0);
  }
  Bench bench("any@write:off");
  rig::Command sent{.brake_duty = 0.6};
  CHECK_FALSE(bench.driver.write({.brake_duty = 0.6}, sent).ok());
  CHECK(sent.brake_duty == 0.0);
}
