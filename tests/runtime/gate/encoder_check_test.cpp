// The check of encoders: speeds that a wheel can have, standing wheels, slip.
#include "runtime/encoder_check.hpp"

#include <cmath>
#include <tuple>
#include <utility>

#include "catch.hpp"
#include "runtime/gate/speed_windows.hpp"

using namespace abs_hil;
using namespace abs_hil::runtime;
using namespace abs_hil::runtime::test;
using rig::Reason;
using Verdict = SpeedInterval::Verdict;

TEST_CASE("a wheel's speed stays within what it can gain and lose") {
  // Gains 100, loses 200 rad/s^2. After 100 rad/s the next 10 ms allow 93.5 less, and 104.5 plus, the reading's slack.
  const auto doubtful_at = [](double omega_rad_s) {
    SpeedInterval interval(100.0, 200.0, 250.0);
    CHECK(interval.update(100.0, 1.0, 0.01) == Verdict::sound);
    CHECK(interval.update(omega_rad_s, 1.0, 0.01) == Verdict::sound);
    return interval.doubtful();
  };
  CHECK_FALSE(doubtful_at(91.2));
  CHECK(doubtful_at(91.0));
  CHECK_FALSE(doubtful_at(107.0));
  CHECK(doubtful_at(107.2));
}

TEST_CASE("the interval widens while readings are outside and narrows with each reading inside") {
  SpeedInterval interval(100.0, 200.0, 250.0);
  static_cast<void>(interval.update(100.0, 1.0, 0.01));
  static_cast<void>(interval.update(80.0, 1.0, 0.01));  // low 93.5
  CHECK(interval.doubtful());
  static_cast<void>(interval.update(90.0, 1.0, 0.01));  // low 91.5, 90 + 2.35 reaches it
  CHECK_FALSE(interval.doubtful());
  static_cast<void>(interval.update(107.0, 1.0, 0.01));  // high was narrowed to 93.35, now 94.35
  CHECK(interval.doubtful());
  // Low is what was known at 91.5, not 90 - 2.35 - 2: the better of the two.
  SpeedInterval twice(100.0, 200.0, 250.0);
  static_cast<void>(twice.update(100.0, 1.0, 0.01));
  static_cast<void>(twice.update(92.0, 1.0, 0.01));  // low stays 93.5, high 95.38
  static_cast<void>(twice.update(88.0, 1.0, 0.01));  // low 91.5: 88 + 2.32 is below
  CHECK(twice.doubtful());
  SpeedInterval high(100.0, 200.0, 250.0);
  static_cast<void>(high.update(100.0, 1.0, 0.01));
  static_cast<void>(high.update(106.5, 1.0, 0.01));  // high stays 104.5, low 101.9
  static_cast<void>(high.update(108.5, 1.0, 0.01));  // high 105.5: 108.5 - 2.63 is above
  CHECK(high.doubtful());
}

TEST_CASE("a wheel may swing back a little after it has stopped, no more") {
  const auto doubtful_at = [](double omega_rad_s) {
    SpeedInterval interval(100.0, 200.0, 250.0);
    for (int i = 0; i < 50; ++i) static_cast<void>(interval.update(0.0, 1.0, 0.01));
    static_cast<void>(interval.update(omega_rad_s, 1.0, 0.01));
    return interval.doubtful();
  };
  CHECK_FALSE(doubtful_at(-2.9));
  CHECK(doubtful_at(-3.2));
}

TEST_CASE("the first reading may be any speed up to the fastest, none below standstill") {
  const auto doubtful_at = [](double omega_rad_s) {
    SpeedInterval interval(100.0, 200.0, 250.0);
    static_cast<void>(interval.update(omega_rad_s, 1.0, 0.001));
    return interval.doubtful();
  };
  CHECK_FALSE(doubtful_at(0.0));
  CHECK_FALSE(doubtful_at(250.0));
  CHECK(doubtful_at(330.0));
  CHECK(doubtful_at(-6.0));
}

TEST_CASE("three readings in a row make a fault, fewer do not") {
  SpeedInterval interval(100.0, 200.0, 250.0);
  static_cast<void>(interval.update(100.0, 1.0, 0.01));
  CHECK(interval.update(0.0, 1.0, 0.01) == Verdict::sound);
  CHECK(interval.update(0.0, 1.0, 0.01) == Verdict::sound);
  CHECK(interval.update(96.0, 1.0, 0.01) == Verdict::sound);
  CHECK_FALSE(interval.doubtful());
  CHECK(interval.update(0.0, 1.0, 0.01) == Verdict::sound);
  CHECK(interval.update(0.0, 1.0, 0.01) == Verdict::sound);
  CHECK(interval.update(0.0, 1.0, 0.01) == Verdict::stuck);
}

TEST_CASE("the readings tell a stuck, a reversed and a jumping encoder apart") {
  const auto verdict_of = [](double omega_rad_s) {
    SpeedInterval interval(100.0, 200.0, 250.0);
    static_cast<void>(interval.update(100.0, 1.0, 0.01));
    static_cast<void>(interval.update(omega_rad_s, 1.0, 0.01));
    static_cast<void>(interval.update(omega_rad_s, 1.0, 0.01));
    return interval.update(omega_rad_s, 1.0, 0.01);
  };
  CHECK(verdict_of(0.0) == Verdict::stuck);
  CHECK(verdict_of(0.9) == Verdict::stuck);
  CHECK(verdict_of(-0.9) == Verdict::stuck);
  CHECK(verdict_of(-5.0) == Verdict::reversed);
  CHECK(verdict_of(-100.0) == Verdict::reversed);
  CHECK(verdict_of(5.0) == Verdict::jumped);
  CHECK(verdict_of(200.0) == Verdict::jumped);
}

TEST_CASE("three readings in a row above the fastest speed are overspeed, less what they may be wrong by") {
  // Gains 1e5 rad/s^2: every reading lies within the interval. 300 rad/s in 10 ms may be wrong by 1 + 300 x 0.15/9.85.
  const double slack_rad_s = 1.0 + 300.0 * 0.15 / 9.85;
  const auto verdict_at = [](double fastest_rad_s, double omega_rad_s) {
    SpeedInterval interval(1e5, 1e5, fastest_rad_s);
    CHECK(interval.update(omega_rad_s, 1.0, 0.01) == Verdict::sound);
    CHECK(interval.update(omega_rad_s, 1.0, 0.01) == Verdict::sound);
    return interval.update(omega_rad_s, 1.0, 0.01);
  };
  CHECK(verdict_at(300.0 - slack_rad_s - 0.01, 300.0) == Verdict::too_fast);
  CHECK(verdict_at(300.0 - slack_rad_s + 0.01, 300.0) == Verdict::sound);
  SpeedInterval interval(1e5, 1e5, 250.0);
  for (const double omega_rad_s : {300.0, 300.0, 200.0, 300.0, 300.0})
    CHECK(interval.update(omega_rad_s, 1.0, 0.01) == Verdict::sound);
  CHECK(interval.update(300.0, 1.0, 0.01) == Verdict::too_fast);
  CHECK_FALSE(interval.doubtful());
}

TEST_CASE("each encoder's fault has its own reason") {
  struct Row {
    double omega1, omega2;
    Reason reason;
    double value;
  };
  const Row row = GENERATE(values<Row>({{0.0, 100.0, Reason::encoder_upper_stuck, 0.0},
                                        {-100.0, 100.0, Reason::encoder_upper_reversed, -100.0},
                                        {150.0, 100.0, Reason::encoder_upper_jumped, 150.0},
                                        {100.0, 0.0, Reason::encoder_lower_stuck, 0.0},
                                        {100.0, -100.0, Reason::encoder_lower_reversed, -100.0},
                                        {100.0, 150.0, Reason::encoder_lower_jumped, 150.0},
                                        {0.0, 0.0, Reason::encoders_lost, 0.0},
                                        {-100.0, -100.0, Reason::encoder_upper_reversed, -100.0}}));
  EncoderCheck check(limits());
  CHECK(run(check, 20, 100.0, 100.0).sound());
  CHECK(run(check, 2, row.omega1, row.omega2).sound());
  const CheckResult found = check.update(speed_window(row.omega1, row.omega2));
  CHECK(found.reason == row.reason);
  CHECK(found.value == row.value);
}

TEST_CASE("either wheel's overspeed is found by its counts") {
  for (const bool upper : {true, false}) {
    EncoderCheck check(plausibility_limits({}, false, {.overspeed_rad_s = 100.0, .free_slip_max = 1.0}));
    double omega = 90.0;
    CheckResult found;
    // 150 rad/s^2: both wheels can do that. A window of 2 ms leaves 8.1 % and 1.5 rad/s open.
    for (; omega < 130.0 && found.sound(); omega += 0.3)
      found = check.update(upper ? speed_window(omega, 90.0) : speed_window(90.0, omega));
    CHECK(found.reason == Reason::overspeed);
    CHECK(found.value == Approx((100.0 + 1.534) / (1.0 - 0.15 / 1.85)).margin(1.0));
  }
}

TEST_CASE("both encoders are lost only if both stand still") {
  EncoderCheck check(limits());
  CHECK(run(check, 20, 100.0, 100.0).sound());
  CHECK(run(check, 2, 100.0, 0.0).sound());
  CHECK(run(check, 1, 0.0, 0.0).reason == Reason::encoders_lost);
}

TEST_CASE("a wheel that the full brake torque locks is no fault") {
  EncoderCheck check(limits());
  double omega1 = 170.0;
  CHECK(run(check, 20, omega1, 170.0).sound());
  for (int i = 0; i < 200; ++i) {
    omega1 = std::max(0.0, omega1 - (9.03 + 2.2885) / 7.54e-3 * dt_s);
    CHECK(check.update(speed_window(omega1, 170.0 - 40.0 * dt_s * i, 9.03)).sound());
  }
}

TEST_CASE("the lag between command and brake torque") {
  EncoderCheck check(limits());
  static_cast<void>(check.update(speed_window(100.0, 100.0, 3.0)));
  const double share = 20.37 * dt_s;
  CHECK(check.brake_torque_Nm() == Approx(3.0 * share / (1.0 + share)));
  for (int i = 0; i < 500; ++i) static_cast<void>(check.update(speed_window(100.0, 100.0, 3.0)));
  CHECK(check.brake_torque_Nm() == Approx(3.0));
  EncoderCheck ideal(plausibility_limits({}, true, {}));
  static_cast<void>(ideal.update(speed_window(100.0, 100.0, 3.0)));
  CHECK(ideal.brake_torque_Nm() == 3.0);
}

TEST_CASE("with the brake long released the wheels roll on each other") {
  const auto found = [](double omega1, double omega2) {
    EncoderCheck check(limits());
    return run(check, 60, omega1, omega2).reason;
  };
  // Allowed: 0.3 m/s + 15 % of the faster one + two counts, in m/s: 1.937 at 100 rad/s.
  CHECK(found(81.0, 100.0) == Reason::none);
  CHECK(found(79.5, 100.0) == Reason::encoders_disagree);
  CHECK(found(118.7, 100.0) == Reason::none);
  CHECK(found(124.0, 100.0) == Reason::encoders_disagree);
  // and near standstill
  CHECK(found(0.0, 5.2) == Reason::none);
  CHECK(found(0.0, 5.5) == Reason::encoder_upper_stuck);
  CHECK(found(6.0, 0.0) == Reason::encoder_lower_stuck);
  EncoderCheck check(limits());
  CHECK(run(check, 60, 75.0, 100.0).value == Approx(0.0995 * 75.0 - 0.099 * 100.0));
}

TEST_CASE("a disagreement must last a tenth of a second, and begins anew after agreement") {
  EncoderCheck check(limits());
  CHECK(run(check, 49, 75.0, 100.0).sound());
  CHECK(run(check, 2, 75.0, 100.0).reason == Reason::encoders_disagree);
  EncoderCheck again(limits());
  CHECK(run(again, 45, 75.0, 100.0).sound());
  CHECK(run(again, 1, 75.0, 75.0).sound());
  CHECK(run(again, 45, 75.0, 100.0).sound());
  CHECK(run(again, 6, 75.0, 100.0).reason == Reason::encoders_disagree);
}

TEST_CASE("a wheel that was braked has three seconds to roll along again") {
  EncoderCheck check(limits());
  CHECK(run(check, 1, 75.0, 100.0, 0.5).sound());
  CHECK(run(check, 1499, 75.0, 100.0).sound());
  CHECK(run(check, 40, 75.0, 100.0).sound());
  CHECK(run(check, 20, 75.0, 100.0).reason == Reason::encoders_disagree);
  // What spoke for a disagreement before does not count.
  EncoderCheck again(limits());
  CHECK(run(again, 45, 75.0, 100.0).sound());
  CHECK(run(again, 1, 75.0, 100.0, 0.5).sound());
  CHECK(run(again, 1499 + 45, 75.0, 100.0).sound());
}

TEST_CASE("a braked wheel is not the faster one") {
  // The torque exceeds 1 N m after about 10 speed windows (3 N m through the lag). The check begins 0.15 s later and
  // needs 0.05 s of impossible speeds.
  EncoderCheck check(limits());
  CHECK(run(check, 105, 110.0, 100.0, 3.0).sound());
  const CheckResult found = run(check, 10, 110.0, 100.0, 3.0);
  CHECK(found.reason == Reason::slip_implausible);
  CHECK(found.value == Approx(1.0 - 0.0995 * 110.0 / (0.099 * 100.0)));
  const auto reason = [](double omega1, double omega2, double brake_Nm) {
    EncoderCheck w(limits());
    return run(w, 400, omega1, omega2, brake_Nm).reason;
  };
  CHECK(reason(104.2, 100.0, 3.0) == Reason::none);  // 4.7 % faster
  CHECK(reason(104.75, 100.0, 3.0) == Reason::slip_implausible);
  CHECK(reason(33.0, 30.0, 3.0) == Reason::none);  // below 3 m/s
  CHECK(reason(34.0, 31.0, 3.0) == Reason::slip_implausible);
  CHECK(reason(110.0, 100.0, 0.98) == Reason::none);
  CHECK(reason(110.0, 100.0, 1.02) == Reason::slip_implausible);
}

TEST_CASE("a faster braked wheel is a fault only after some time without interruption") {
  EncoderCheck check(limits());
  CHECK(run(check, 150, 100.0, 100.0, 3.0).sound());
  CHECK(run(check, 24, 110.0, 100.0, 3.0).sound());
  CHECK(run(check, 1, 104.0, 100.0, 3.0).sound());
  CHECK(run(check, 24, 110.0, 100.0, 3.0).sound());
  CHECK(run(check, 2, 110.0, 100.0, 3.0).reason == Reason::slip_implausible);
  // A release of the brake in between restarts the time, too: 1.3 N m give 1 N m after 36 windows, and the check begins
  // 75 windows later.
  EncoderCheck pulsed(limits());
  CHECK(run(pulsed, 121, 110.0, 100.0, 1.3).sound());
  CHECK(run(pulsed, 30, 110.0, 100.0, 0.0).sound());
  CHECK(run(pulsed, 120, 110.0, 100.0, 1.3).sound());
}

TEST_CASE("with coarse encoders a braked wheel must be ahead by more than their counts") {
  // Two counts are 20 rad/s: (r1 + 1.05 r2) 20 * 2 ms = 8.14 mm. 106 rad/s are ahead by 0.152 m/s, 0.304 mm a window.
  EncoderCheck check(limits());
  const auto coarse = [&check](int count, double omega1) {
    for (int i = 0; i < count; ++i) {
      SpeedWindow w = speed_window(omega1, 100.0, 3.0);
      w.resolution_rad_s = 20.0;
      const CheckResult found = check.update(w);
      if (!found.sound()) return found;
    }
    return CheckResult{};
  };
  CHECK(coarse(100, 99.0).sound());
  CHECK(coarse(26, 106.0).sound());
  CHECK(coarse(2, 106.0).reason == Reason::slip_implausible);
}
