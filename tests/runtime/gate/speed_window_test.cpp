// Windows of readings: mean speeds, stale readings, leaps.
#include "runtime/speed_window.hpp"

#include <limits>

#include "catch.hpp"

using namespace abs_hil;
using namespace abs_hil::runtime;
using rig::Reason;

namespace {

constexpr std::int64_t us = 1'000;
constexpr std::int64_t ms = 1'000'000;
constexpr double rad_per_count = 6.283185307179586 / 4096.0;

PlausibilityLimits limits() { return plausibility_limits({}, false, {.sample_age_max_s = 0.02}); }

rig::Measurement at(std::int64_t time_ns, std::int32_t upper = 0, std::int32_t lower = 0) {
  return {.time_ns = time_ns, .upper_counts = upper, .lower_counts = lower};
}

}  // namespace

TEST_CASE("a speed window is complete after about two cycles at 1 kHz and begins where the previous one ended") {
  SpeedWindows maker(limits());
  CHECK(maker.update(at(5 * ms, 100, 200), 5 * ms, {}).sound());
  CHECK_FALSE(maker.complete());
  CHECK(maker.update(at(6'790 * us, 140, 260), 6'790 * us, {}).sound());
  CHECK_FALSE(maker.complete());
  CHECK(maker.update(at(7 * ms, 150, 280), 7 * ms, {}).sound());
  REQUIRE(maker.complete());
  CHECK(maker.speed_window().dt_s == Approx(0.002));
  CHECK(maker.speed_window().omega1_rad_s == Approx(50 * rad_per_count / 0.002));
  CHECK(maker.speed_window().omega2_rad_s == Approx(80 * rad_per_count / 0.002));
  CHECK(maker.speed_window().resolution_rad_s == Approx(2 * rad_per_count / 0.002));
  CHECK(maker.update(at(8 * ms, 150, 280), 8 * ms, {}).sound());
  CHECK_FALSE(maker.complete());
  CHECK(maker.update(at(8'810 * us, 140, 290), 8'810 * us, {}).sound());
  REQUIRE(maker.complete());
  CHECK(maker.speed_window().omega1_rad_s == Approx(-10 * rad_per_count / 0.00181));
  CHECK(maker.speed_window().omega2_rad_s == Approx(10 * rad_per_count / 0.00181));
}

TEST_CASE("commands count as long as they act") {
  SpeedWindows maker(limits());
  static_cast<void>(
      maker.update(at(1 * ms), 1 * ms, {.motor_duty = 1.0, .brake_duty = 1.0}));  // before the speed window
  static_cast<void>(maker.update(at(2 * ms), 2 * ms, {.motor_duty = 0.4, .brake_duty = 0.5}));
  static_cast<void>(maker.update(at(5 * ms), 5 * ms, {.motor_duty = 0.8, .brake_torque_Nm = 9.0}));
  REQUIRE(maker.complete());
  CHECK(maker.speed_window().motor_duty == Approx((0.4 * 1 + 0.8 * 3) / 4.0));
  CHECK(maker.speed_window().brake_target_Nm == Approx((15.24 * 0.5 - 6.21) * 1 / 4.0));  // the torque is no hardware's
  static_cast<void>(maker.update(at(7 * ms), 7 * ms, {.motor_duty = 0.4, .brake_duty = 0.5}));
  CHECK(maker.speed_window().motor_duty == Approx(0.4));
  CHECK(maker.speed_window().brake_target_Nm == Approx(15.24 * 0.5 - 6.21));
  SpeedWindows ideal(plausibility_limits({}, true, {}));
  static_cast<void>(ideal.update(at(1 * ms), 1 * ms, {}));
  static_cast<void>(ideal.update(at(3 * ms), 3 * ms, {.brake_duty = 0.5, .brake_torque_Nm = 9.0}));
  CHECK(ideal.speed_window().brake_target_Nm == Approx(9.0));
}

TEST_CASE("a brake with dead time acts as late as that, and in parts of a window") {
  rig::RigParameters late;
  late.brake.brake_dead_time_s = 0.0035;
  SpeedWindows maker(plausibility_limits(late, false, {}));
  const auto window_to = [&maker](std::int64_t time_ns, double duty) {
    static_cast<void>(maker.update(at(time_ns), time_ns, {.brake_duty = duty}));
    return maker.speed_window().brake_target_Nm;
  };
  const double half_Nm = 15.24 * 0.5 - 6.21, full_Nm = 15.24 - 6.21;
  static_cast<void>(window_to(1 * ms, 0.0));
  CHECK(window_to(3 * ms, 0.5) == 0.0);                    // sent at 1 ms, acts from 4.5 ms on
  CHECK(window_to(5 * ms, 1.0) == Approx(half_Nm / 4.0));  // sent at 3 ms, acts from 6.5 ms on
  CHECK(window_to(7 * ms, 1.0) == Approx((3.0 * half_Nm + full_Nm) / 4.0));
  CHECK(window_to(9 * ms, 0.0) == Approx(full_Nm));  // sent at 7 ms, acts from 10.5 ms on
  CHECK(window_to(11 * ms, 0.0) == Approx(full_Nm * 0.75));
  CHECK(window_to(13 * ms, 0.0) == 0.0);
}

TEST_CASE("no fresh measurement for 20 ms and five cycles is a fault") {
  SpeedWindows maker(limits());
  static_cast<void>(maker.update(at(10 * ms), 10 * ms, {}));
  for (int i = 1; i < 20; ++i) CHECK(maker.update(at(10 * ms), (10 + i) * ms, {}).sound());
  const CheckResult found = maker.update(at(10 * ms), 30 * ms, {});
  CHECK(found.reason == Reason::samples_missing);
  CHECK(found.value == Approx(0.02));
}

TEST_CASE("one delayed answer is no fault, five are") {
  SpeedWindows maker(limits());
  static_cast<void>(maker.update(at(10 * ms), 10 * ms, {}));
  for (int i = 1; i < 5; ++i) CHECK(maker.update(at(10 * ms), (10 + 100 * i) * ms, {}).sound());
  CHECK_FALSE(maker.update(at(10 * ms), 510 * ms, {}).sound());

  SpeedWindows recovering(limits());
  static_cast<void>(recovering.update(at(10 * ms), 10 * ms, {}));
  for (int i = 1; i < 5; ++i) CHECK(recovering.update(at(10 * ms), (10 + 100 * i) * ms, {}).sound());
  CHECK(recovering.update(at(411 * ms), 411 * ms, {}).sound());
  for (int i = 1; i < 5; ++i) CHECK(recovering.update(at(411 * ms), (411 + 100 * i) * ms, {}).sound());
}

TEST_CASE("stamps from the past, from the future or running back are not fresh") {
  const auto lost = [](auto&& stamp_of) {
    SpeedWindows maker(limits());
    static_cast<void>(maker.update(at(10 * ms), 10 * ms, {}));
    CheckResult found{};
    for (std::int64_t now_ms = 11; now_ms <= 40; ++now_ms) {
      found = maker.update(at(stamp_of(now_ms)), now_ms * ms, {});
      if (!found.sound()) break;
    }
    return found.reason == Reason::samples_missing;
  };
  CHECK_FALSE(lost([](std::int64_t now_ms) { return now_ms * ms; }));
  CHECK_FALSE(lost([](std::int64_t now_ms) { return now_ms * ms + 19 * ms; }));
  CHECK(lost([](std::int64_t now_ms) { return now_ms * ms + 21 * ms; }));
  CHECK(lost([](std::int64_t now_ms) { return now_ms * ms - 21 * ms; }));
  CHECK(lost([](std::int64_t now_ms) { return (21 - now_ms / 10) * ms; }));
}

TEST_CASE("a run whose very first measurements are old never starts") {
  SpeedWindows maker(limits());
  CheckResult found{};
  for (std::int64_t now_ms = 1000; now_ms < 1010; ++now_ms) found = maker.update(at(1 * ms), now_ms * ms, {});
  CHECK(found.reason == Reason::samples_missing);
  // A stamp of 0 is as good as any.
  SpeedWindows zero(limits());
  CHECK(zero.update(at(0, 5), 0, {}).sound());
  CHECK(zero.update(at(2 * ms, 7), 2 * ms, {}).sound());
  REQUIRE(zero.complete());
  CHECK(zero.speed_window().omega1_rad_s == Approx(2 * rad_per_count / 0.002));
}

TEST_CASE("a counter that leaps is found in the same cycle, and its measurement is not used") {
  // Twice 250 rad/s over 1 ms and 1 ms more is 1 rad, 651.9 counts.
  for (const std::int32_t sign : {1, -1}) {
    SpeedWindows upper(limits());
    CHECK(upper.update(at(1 * ms, 1000, 1000), 1 * ms, {}).sound());
    CHECK(upper.usable());
    CHECK(upper.update(at(2 * ms, 1000 + 650 * sign, 1000 - 650 * sign), 2 * ms, {}).sound());
    CHECK(upper.usable());
    const CheckResult found = upper.update(at(3 * ms, 1000 + 1304 * sign, 1000), 3 * ms, {});
    CHECK(found.reason == Reason::encoder_upper_jumped);
    CHECK(found.value == Approx(654 * sign * rad_per_count));
    CHECK_FALSE(upper.usable());
    CHECK_FALSE(upper.complete());
    SpeedWindows lower(limits());
    CHECK(lower.update(at(1 * ms), 1 * ms, {}).sound());
    const CheckResult below = lower.update(at(3 * ms, 0, 980 * sign), 3 * ms, {});  // 1.5 rad are 977.8 counts
    CHECK(below.reason == Reason::encoder_lower_jumped);
    CHECK(below.value == Approx(980 * sign * rad_per_count));
    CHECK_FALSE(lower.usable());
    SpeedWindows slower(limits());
    CHECK(slower.update(at(1 * ms), 1 * ms, {}).sound());
    CHECK(slower.update(at(3 * ms, 0, 975 * sign), 3 * ms, {}).sound());
  }
}

TEST_CASE("a window lasts until its stamps are certain enough, and says how certain they are") {
  // A reading of 0.6 ms with its stamp at the beginning: 1.2 ms at both ends are a quarter of 4.8 ms.
  SpeedWindows maker(limits());
  for (int i = 0; i <= 4; ++i) {
    CHECK(maker.update(at((1 + i) * ms, 100 * i, 50 * i), (1 + i) * ms, {.motor_duty = 0.5}, 600 * us).sound());
    CHECK_FALSE(maker.complete());
    CHECK(maker.overdue() == (i >= 2));
  }
  CHECK(maker.update(at(6 * ms, 500, 250), 6 * ms, {.motor_duty = 0.5}, 600 * us).sound());
  REQUIRE(maker.complete());
  CHECK_FALSE(maker.overdue());
  CHECK(maker.speed_window().dt_s == Approx(0.005));
  CHECK(maker.speed_window().omega1_rad_s == Approx(500 * rad_per_count / 0.005));
  CHECK(maker.speed_window().begin_error_s == Approx(600e-6));
  CHECK(maker.speed_window().end_error_s == Approx(600e-6));
  CHECK(maker.speed_window().motor_duty == Approx(0.5));
}

TEST_CASE("one delayed reading does not end a window; the next prompt one does") {
  SpeedWindows maker(limits());
  CHECK(maker.update(at(1 * ms), 1 * ms, {}).sound());
  CHECK(maker.update(at(4 * ms, 100), 4 * ms, {}, 751 * us).sound());  // a quarter of 3 ms is 750 us
  CHECK(maker.usable());
  CHECK_FALSE(maker.complete());
  CHECK(maker.overdue());
  CHECK(maker.update(at(5 * ms, 200), 5 * ms, {}).sound());
  REQUIRE(maker.complete());
  CHECK(maker.speed_window().dt_s == Approx(0.004));
  CHECK(maker.speed_window().omega1_rad_s == Approx(200 * rad_per_count / 0.004));
  CHECK(maker.speed_window().stamp_error_s() == 0.0);
  // Exactly a quarter is enough.
  SpeedWindows just(limits());
  CHECK(just.update(at(1 * ms), 1 * ms, {}).sound());
  CHECK(just.update(at(4 * ms, 100), 4 * ms, {}, 750 * us).sound());
  CHECK(just.complete());
}

TEST_CASE("a stamp in the middle of a reading is twice as certain as one at its end") {
  const auto error_s = [](std::int64_t stamp_us) {
    SpeedWindows maker(limits());
    static_cast<void>(maker.update(at(0), 0, {}));
    static_cast<void>(maker.update(at(10 * ms + stamp_us * us), 10 * ms, {}, 400 * us));
    return maker.speed_window().end_error_s;
  };
  CHECK(error_s(0) == Approx(400e-6));
  CHECK(error_s(200) == Approx(200e-6));
  CHECK(error_s(100) == Approx(300e-6));
  CHECK(error_s(400) == Approx(400e-6));
  // A stamp outside the reading counts as its nearer end.
  CHECK(error_s(-500) == Approx(400e-6));
  CHECK(error_s(900) == Approx(400e-6));
}

TEST_CASE("a counter may move further by what the stamps leave open, no more") {
  // 500 rad/s over 1 ms, 1 ms more, and 0.3 ms of each of the two stamps: 1.3 rad, 847.5 counts, and two counts.
  const auto found = [](std::int32_t counts) {
    SpeedWindows maker(limits());
    static_cast<void>(maker.update(at(1 * ms), 1 * ms, {}, 300 * us));
    return maker.update(at(2 * ms, counts), 2 * ms, {}, 300 * us);
  };
  CHECK(found(849).sound());
  CHECK(found(850).reason == Reason::encoder_upper_jumped);
}

TEST_CASE("an encoder with few counts does not leap, and its windows last until they resolve a speed") {
  rig::RigParameters rig;
  rig.encoder_counts_per_rev = 4;
  SpeedWindows maker(plausibility_limits(rig, false, {}));
  // Two counts of a quarter turn within 40 rad/s: 78.5 ms.
  std::int32_t counts = 0;
  for (int cycle = 0; cycle <= 78; ++cycle) {
    counts = cycle / 10;
    CHECK(maker.update(at(cycle * ms, counts, counts), cycle * ms, {}).sound());
    CHECK_FALSE(maker.complete());
    CHECK(maker.overdue() == (cycle >= 2));
  }
  CHECK(maker.update(at(79 * ms, counts, counts), 79 * ms, {}).sound());
  CHECK(maker.complete());
  CHECK(maker.speed_window().resolution_rad_s == Approx(3.14159265 / 0.079));
}

TEST_CASE("a stale measurement is not used") {
  SpeedWindows maker(limits());
  CHECK(maker.usable());
  static_cast<void>(maker.update(at(10 * ms), 10 * ms, {}));
  CHECK_FALSE(maker.overdue());
  static_cast<void>(maker.update(at(10 * ms), 11 * ms, {}));
  CHECK_FALSE(maker.usable());
  CHECK(maker.overdue());
  static_cast<void>(maker.update(at(12 * ms), 12 * ms, {}));
  CHECK(maker.usable());
}

TEST_CASE("a counter leaps however short the time between two measurements is") {
  // 500 rad/s over 1 ms and 1 ns: 0.5 rad, 325.95 counts, and two counts.
  const auto found = [](std::int32_t upper, std::int32_t lower) {
    SpeedWindows maker(limits());
    static_cast<void>(maker.update(at(1 * ms), 1 * ms, {}));
    return maker.update(at(1 * ms + 1, upper, lower), 1 * ms + 1, {}).reason;
  };
  CHECK(found(327, -327) == Reason::none);
  CHECK(found(329, 0) == Reason::encoder_upper_jumped);
  CHECK(found(-329, 0) == Reason::encoder_upper_jumped);
  CHECK(found(0, 329) == Reason::encoder_lower_jumped);
  CHECK(found(0, -329) == Reason::encoder_lower_jumped);
  CHECK(found(std::numeric_limits<std::int32_t>::min(), 0) == Reason::encoder_upper_jumped);
}

TEST_CASE("fast counts that are no leap complete a window") {
  SpeedWindows maker(limits());
  static_cast<void>(maker.update(at(1 * ms), 1 * ms, {}));
  CHECK(maker.update(at(3 * ms, 800, -800), 3 * ms, {}).sound());
  REQUIRE(maker.complete());
  CHECK(maker.speed_window().omega1_rad_s == Approx(800 * rad_per_count / 0.002));
}
