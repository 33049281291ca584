// The check that the wheels answer to motor and brake.
#include "runtime/response_check.hpp"

#include <algorithm>
#include <utility>

#include "catch.hpp"

using namespace abs_hil;
using namespace abs_hil::runtime;
using rig::Reason;

namespace {

constexpr double dt_s = 0.002;
/// Momentum of both wheels at 1 rad/s, kg m/s: J1 / r1 + J2 / r2.
constexpr double inertia_kg_m = 7.54e-3 / 0.0995 + 25.6e-3 / 0.099;

PlausibilityLimits paper_limits() {
  const rig::RigParameters rig{};
  const GateOptions options{};
  return plausibility_limits(rig, false, options);
}

const double stall_Nm = rig::RigParameters{}.motor.stall_torque_Nm;

struct Bench {
  ResponseCheck check{paper_limits()};
  double omega1{0.0}, omega2{0.0};

  /// Speed windows with both wheels changing speed steadily; what is found first.
  CheckResult run(int count, double rad_s2, double motor_duty = 0.0, double brake_Nm = 0.0) {
    for (int i = 0; i < count; ++i) {
      omega1 += rad_s2 * dt_s;
      omega2 += rad_s2 * dt_s;
      const CheckResult found = check.update({.dt_s = dt_s,
                                              .omega1_rad_s = omega1,
                                              .omega2_rad_s = omega2,
                                              .motor_duty = motor_duty,
                                              .motor_stall_Nm = stall_Nm * motor_duty},
                                             brake_Nm);
      if (!found.sound()) return found;
    }
    return {};
  }
};

/// Two windows and a little, from equal speeds of both wheels.
CheckResult found(double omega_rad_s, double rad_s2, double motor_duty = 0.0, double brake_Nm = 0.0) {
  Bench bench{.omega1 = omega_rad_s, .omega2 = omega_rad_s};
  return bench.run(103, rad_s2, motor_duty, brake_Nm);
}

}  // namespace

TEST_CASE("wheels do not gain speed with the motor off") {
  // 0.25 kg m/s in a window of 0.1 s is 7.48 rad/s^2.
  CHECK(found(50.0, 7.3).sound());
  const CheckResult rising = found(50.0, 7.8);
  CHECK(rising.reason == Reason::speed_rises_with_motor_off);
  CHECK(rising.value == Approx(7.8 * 0.1 * inertia_kg_m).epsilon(0.03));
  CHECK(found(50.0, 0.0).sound());
  CHECK(found(50.0, -30.0).sound());
}

TEST_CASE("each wheel counts with its inertia over its radius") {
  // The upper wheel alone at 33 rad/s^2, the lower one at 9.7: 0.25 kg m/s each.
  Bench upper;
  CheckResult result{};
  for (int i = 0; i < 103 && result.sound(); ++i) {
    result = upper.check.update({.dt_s = dt_s, .omega1_rad_s = 34.0 * dt_s * i}, 0.0);
  }
  CHECK(result.reason == Reason::speed_rises_with_motor_off);
  CHECK(result.value == Approx(34.0 * 0.1 * 7.54e-3 / 0.0995).epsilon(0.03));
  Bench lower;
  result = {};
  for (int i = 0; i < 103 && result.sound(); ++i) {
    result = lower.check.update({.dt_s = dt_s, .omega2_rad_s = 10.0 * dt_s * i}, 0.0);
  }
  CHECK(result.value == Approx(10.0 * 0.1 * 25.6e-3 / 0.099).epsilon(0.03));
}

TEST_CASE("while the motor is on, and in the window in which it ends, speed may rise") {
  CHECK(found(50.0, 30.0, 1e-3).sound());
  Bench ended{.omega1 = 50.0, .omega2 = 50.0};
  CHECK(ended.run(52, 30.0, 1.0).sound());
  CHECK(ended.run(30, 30.0).sound());  // within the second window
  CHECK(ended.run(22, 0.0).sound());
  Bench begun{.omega1 = 50.0, .omega2 = 50.0};
  CHECK(begun.run(60, 0.0).sound());
  CHECK(begun.run(43, 30.0, 1.0).sound());
  Bench still_on{.omega1 = 50.0, .omega2 = 50.0};
  CHECK(still_on.run(60, 30.0, 1.0).sound());
  CHECK(still_on.run(100, 30.0).sound());
  CHECK(still_on.run(103, 30.0).reason == Reason::speed_rises_with_motor_off);
}

TEST_CASE("the check finds nothing before two windows have passed") {
  Bench bench{.omega1 = 50.0, .omega2 = 50.0};
  CHECK(bench.run(98, 60.0).sound());
  CHECK(bench.run(5, 60.0).reason == Reason::speed_rises_with_motor_off);
}

TEST_CASE("the motor accelerates the wheels by at least a quarter of what it should") {
  // From rest at full duty: (2.1122 - 2 0.0925) / 0.099 0.1 s = 1.947 kg m/s; a quarter is 14.6 rad/s^2.
  CHECK(found(0.0, 15.2, 1.0).sound());
  const CheckResult weak = found(0.0, 13.6, 1.0);
  CHECK(weak.reason == Reason::motor_no_response);
  CHECK(weak.value == Approx(13.6 * 0.1 * inertia_kg_m).epsilon(0.03));
  // What duty 0.228 should give at rest is 0.3 kg m/s: less is not looked for.
  CHECK(found(0.0, 0.0, 0.222).sound());
  CHECK(found(0.0, 0.0, 0.234).reason == Reason::motor_no_response);
  // Back-EMF and twice the friction: 0.3 kg m/s at 161.7 rad/s.
  CHECK(found(160.0, 0.0, 1.0).reason == Reason::motor_no_response);
  CHECK(found(163.5, 0.0, 1.0).sound());
}

TEST_CASE("both windows count towards what the motor should give") {
  Bench late;
  CHECK(late.run(51, 0.0).sound());
  // One window of full duty counts half: 0.87 of them, 14.6 rad/s^2 in one window moves the mean by half as much.
  CHECK(late.run(50, 20.0, 1.0).sound());
  Bench never;
  CHECK(never.run(51, 0.0).sound());
  CHECK(never.run(52, 0.0, 1.0).reason == Reason::motor_no_response);
  Bench only_before;
  CHECK(only_before.run(50, 0.0, 1.0).sound());
  CHECK(only_before.run(53, 0.0).reason == Reason::motor_no_response);
}

TEST_CASE("a motor that works against the brake is not checked") {
  CHECK(found(0.0, 0.0, 1.0, 0.105).sound());
  CHECK(found(0.0, 0.0, 1.0, 0.095).reason == Reason::motor_no_response);
  Bench braked_before;
  CHECK(braked_before.run(20, 0.0, 1.0, 0.5).sound());
  CHECK(braked_before.run(83, 0.0, 1.0).sound());
  CHECK(braked_before.run(53, 0.0, 1.0).reason == Reason::motor_no_response);
  Bench braked_after;
  CHECK(braked_after.run(70, 0.0, 1.0).sound());
  CHECK(braked_after.run(33, 0.0, 1.0, 0.5).sound());
}

TEST_CASE("the brake takes at least three tenths of what it should") {
  // 3 N m / 0.0995 m 0.1 s = 3.015 kg m/s; three tenths are 27.05 rad/s^2.
  CHECK(found(100.0, -27.7, 0.0, 3.0).sound());
  const CheckResult weak = found(100.0, -26.4, 0.0, 3.0);
  CHECK(weak.reason == Reason::brake_no_response);
  CHECK(weak.value == Approx(-26.4 * 0.1 * inertia_kg_m).epsilon(0.03));
  CHECK(found(100.0, 0.0, 0.0, 1.45).sound());
  CHECK(found(100.0, 0.0, 0.0, 1.55).reason == Reason::brake_no_response);
  // Momentum above 5 kg m/s, 14.95 rad/s, only.
  CHECK(found(14.8, 0.0, 0.0, 3.0).sound());
  CHECK(found(15.1, 0.0, 0.0, 3.0).reason == Reason::brake_no_response);
}

TEST_CASE("the brake is checked only at 1.5 N m or more through both windows, on a rolling wheel, with the motor off") {
  Bench weak_before{.omega1 = 100.0, .omega2 = 100.0};
  CHECK(weak_before.run(1, 0.0, 0.0, 1.0).sound());
  CHECK(weak_before.run(102, 0.0, 0.0, 3.0).sound());
  CHECK(weak_before.run(53, 0.0, 0.0, 3.0).reason == Reason::brake_no_response);
  Bench weak_now{.omega1 = 100.0, .omega2 = 100.0};
  CHECK(weak_now.run(90, 0.0, 0.0, 3.0).sound());
  CHECK(weak_now.run(13, 0.0, 0.0, 1.0).sound());

  // Rolling is half the speed or more: r1 omega1 >= 0.5 r2 omega2.
  Bench slow{.omega1 = 49.0, .omega2 = 100.0};
  CHECK(slow.run(103, 0.0, 0.0, 3.0).sound());
  Bench fast{.omega1 = 50.5, .omega2 = 100.0};
  CHECK(fast.run(103, 0.0, 0.0, 3.0).reason == Reason::brake_no_response);
  Bench locked_before{.omega1 = 0.0, .omega2 = 100.0};
  CHECK(locked_before.run(1, 0.0, 0.0, 3.0).sound());
  locked_before.omega1 = 100.0;
  CHECK(locked_before.run(102, 0.0, 0.0, 3.0).sound());
  CHECK(locked_before.run(53, 0.0, 0.0, 3.0).reason == Reason::brake_no_response);
  Bench locked_now{.omega1 = 100.0, .omega2 = 100.0};
  CHECK(locked_now.run(80, 0.0, 0.0, 3.0).sound());
  locked_now.omega1 = 0.0;
  CHECK(locked_now.run(1, 0.0, 0.0, 3.0).sound());
  locked_now.omega1 = 100.0;
  CHECK(locked_now.run(22, 0.0, 0.0, 3.0).sound());

  CHECK(found(100.0, 0.0, 0.01, 3.0).sound());
}

TEST_CASE("both windows count towards what the brake should take") {
  Bench harder{.omega1 = 100.0, .omega2 = 100.0};
  CHECK(harder.run(51, -20.0, 0.0, 2.0).sound());
  // The mean of 2 and 4 N m is 3: 27 rad/s^2.
  CHECK(harder.run(52, -34.5, 0.0, 4.0).sound());
  Bench too_little{.omega1 = 100.0, .omega2 = 100.0};
  CHECK(too_little.run(51, -26.0, 0.0, 2.0).sound());
  CHECK(too_little.run(52, -26.0, 0.0, 4.0).reason == Reason::brake_no_response);
}

namespace {

/// Time until something is found, s, with stamps that may be wrong by `stamp_error_s` at each end; 0: nothing.
std::pair<double, Reason> found_after(double omega_rad_s, double rad_s2, double stamp_error_s, double resolution_rad,
                                      double motor_duty, double brake_Nm) {
  ResponseCheck check(paper_limits());
  for (int i = 1; i <= 1500; ++i) {
    omega_rad_s += rad_s2 * dt_s;
    const CheckResult found = check.update({.dt_s = dt_s,
                                            .omega1_rad_s = omega_rad_s,
                                            .omega2_rad_s = omega_rad_s,
                                            .resolution_rad_s = resolution_rad / dt_s,
                                            .begin_error_s = stamp_error_s,
                                            .end_error_s = stamp_error_s,
                                            .motor_duty = motor_duty,
                                            .motor_stall_Nm = stall_Nm * motor_duty},
                                           brake_Nm);
    if (!found.sound()) return {i * dt_s, found.reason};
  }
  return {0.0, Reason::none};
}

}  // namespace

TEST_CASE("uncertain stamps lengthen the windows until the momentum is certain enough, and no further") {
  // p is 33.44 kg m/s at 100 rad/s. A window T ends when p 2 e / T <= T: e = 0.6 ms: 0.2003 s; two of them.
  const auto [late_s, late] = found_after(100.0, 0.0, 600e-6, 0.0, 0.0, 3.0);
  CHECK(late == Reason::brake_no_response);
  CHECK(late_s == Approx(0.404));
  const auto [prompt_s, prompt] = found_after(100.0, 0.0, 0.0, 0.0, 0.0, 3.0);
  CHECK(prompt == Reason::brake_no_response);
  CHECK(prompt_s == Approx(0.2).margin(0.005));
  // No window is longer than 1 s.
  const auto [longest_s, longest] = found_after(100.0, 0.0, 20e-3, 0.0, 0.0, 6.0);
  CHECK(longest == Reason::brake_no_response);
  CHECK(longest_s == Approx(2.0).margin(0.005));
}

TEST_CASE("what the stamps and counts leave open is no fault") {
  // Motor off, rising by 9 rad/s^2: 0.25 kg m/s are exceeded in 0.1 s, but not with 0.3 ms at each end: windows of
  // 0.142 s, 0.283 kg m/s of slack and 0.427 gained.
  CHECK(found_after(100.0, 9.0, 0.0, 0.0, 0.0, 0.0).second == Reason::speed_rises_with_motor_off);
  CHECK(found_after(100.0, 9.0, 300e-6, 0.0, 0.0, 0.0).second == Reason::none);
  CHECK(found_after(100.0, 30.0, 300e-6, 0.0, 0.0, 0.0).second == Reason::speed_rises_with_motor_off);
  // Two counts of a quarter turn, pi: 1.05 kg m/s in each window of 1 s.
  CHECK(found_after(100.0, 5.0, 0.0, 3.14159265, 0.0, 0.0).second == Reason::none);
  CHECK(found_after(10.0, 10.0, 0.0, 3.14159265, 0.0, 0.0).second == Reason::speed_rises_with_motor_off);
  // The motor's response: 2.1 N m give 2.1 kg m/s in 0.1 s at standstill; friction is small.
  CHECK(found_after(1.0, 3.0, 0.0, 0.0, 1.0, 0.0).second == Reason::motor_no_response);
  CHECK(found_after(1.0, 3.0, 0.0, 0.5, 1.0, 0.0).second == Reason::motor_no_response);
}

TEST_CASE("two counts leave each wheel's momentum open by its inertia over its radius") {
  // Two counts of 0.02 rad: 0.0669 kg m/s in a window of 0.1 s, twice.
  const auto reason = [](double omega_rad_s, double rad_s2, double motor_duty, double brake_Nm) {
    return found_after(omega_rad_s, rad_s2, 0.0, 0.02, motor_duty, brake_Nm).second;
  };
  // Rising by (0.25 + 0.1337) / (0.1 inertia) = 11.47 rad/s^2.
  CHECK(reason(10.0, 11.0, 0.0, 0.0) == Reason::none);
  CHECK(reason(10.0, 12.0, 0.0, 0.0) == Reason::speed_rises_with_motor_off);
  // The motor's quarter, 0.4868 kg m/s: (0.4868 - 0.1337) / (0.1 inertia) = 10.56 rad/s^2.
  CHECK(reason(0.0, 11.0, 1.0, 0.0) == Reason::none);
  CHECK(reason(0.0, 10.0, 1.0, 0.0) == Reason::motor_no_response);
  // Three tenths of 3 N m, 0.9045 kg m/s: (0.9045 - 0.1337) / (0.1 inertia) = 23.05 rad/s^2.
  CHECK(reason(100.0, -24.0, 0.0, 3.0) == Reason::none);
  CHECK(reason(100.0, -22.0, 0.0, 3.0) == Reason::brake_no_response);
}

TEST_CASE("the stamp at the very beginning of a window counts, not those within") {
  // Windows of 52 times 2^-9 s. 2 ms at the beginning of each leave 0.07 kg m/s open.
  const auto reason = [](double begin_error_s) {
    ResponseCheck check(paper_limits());
    constexpr double short_s = 1.0 / 512.0;
    for (int i = 0; i < 105; ++i) {
      const double omega_rad_s = 10.0 + 10.8 * short_s * i;
      const CheckResult found = check.update({.dt_s = short_s,
                                              .omega1_rad_s = omega_rad_s,
                                              .omega2_rad_s = omega_rad_s,
                                              .begin_error_s = i % 52 == 0 ? begin_error_s : 0.0},
                                             0.0);
      if (!found.sound()) return found.reason;
    }
    return Reason::none;
  };
  CHECK(reason(0.0) == Reason::speed_rises_with_motor_off);
  CHECK(reason(2e-3) == Reason::none);
}

TEST_CASE("motor and brake are judged by the momentum of wheels that are apart, too") {
  const double upper_kg_m = 7.54e-3 / 0.0995;
  const auto braked = [&](double omega1, double omega2, double rad_s2, double brake_Nm) {
    ResponseCheck check(paper_limits());
    check.note_wheels_apart(true);
    for (int i = 0; i < 103; ++i) {
      omega1 = std::max(0.0, omega1 + rad_s2 * dt_s);
      const CheckResult found = check.update({.dt_s = dt_s, .omega1_rad_s = omega1, .omega2_rad_s = omega2}, brake_Nm);
      if (!found.sound()) return found;
    }
    return CheckResult{};
  };
  // 2 N m take 2.01 kg m/s from the upper wheel in 0.1 s: 26.5 rad/s. It has to have lost three tenths of it.
  const double full_rad_s2 = -2.0 / 0.0995 / upper_kg_m;
  CHECK(braked(100.0, 0.0, 0.31 * full_rad_s2, 2.0).sound());
  CHECK(braked(100.0, 0.0, 0.29 * full_rad_s2, 2.0).reason == Reason::brake_no_response);
  CHECK(braked(60.0, 170.0, 0.0, 2.0).reason == Reason::brake_no_response);  // it need not roll on the other one
  CHECK(braked(20.0, 170.0, full_rad_s2, 2.0).sound());  // it stands soon, and then loses nothing more
  CHECK(braked(0.0, 170.0, 0.0, 2.0).sound());
  CHECK(braked(25.0, 170.0, 0.0, 2.0).sound());  // it may have stood in between
  CHECK(braked(28.0, 170.0, 0.0, 2.0).reason == Reason::brake_no_response);
  // Once they are joined, the upper wheel must roll along to be judged.
  Bench joined{.omega1 = 40.0};
  joined.check.note_wheels_apart(true);
  joined.check.note_wheels_apart(false);
  for (int i = 0; i < 103; ++i) {
    CHECK(joined.check.update({.dt_s = dt_s, .omega1_rad_s = 40.0, .omega2_rad_s = 170.0}, 2.0).sound());
  }
  // The lower wheel is silent although the motor drives it, whatever the upper one does.
  Bench silent{.omega1 = 100.0};
  silent.check.note_wheels_apart(true);
  CheckResult found{};
  for (int i = 0; i < 103 && found.sound(); ++i) {
    found =
        silent.check.update({.dt_s = dt_s, .omega1_rad_s = 100.0, .motor_duty = 1.0, .motor_stall_Nm = stall_Nm}, 0.0);
  }
  CHECK(found.reason == Reason::motor_no_response);
}
