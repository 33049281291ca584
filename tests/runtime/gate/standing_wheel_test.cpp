// A stuck upper encoder or a locked wheel? Once the brake has let go, a locked wheel turns; a stuck encoder does not.

#include <algorithm>
#include <cmath>
#include <numbers>

#include "catch.hpp"
#include "runtime/encoder_check.hpp"

using namespace abs_hil;
using namespace abs_hil::runtime;
using rig::Reason;

namespace {

constexpr double dt_s = 0.002;
constexpr double count_rad = 2.0 * std::numbers::pi / 4096.0;

PlausibilityLimits limits() {
  return plausibility_limits({}, false, {.overspeed_rad_s = 250.0, .free_slip_max = 0.15});
}

CheckResult step(EncoderCheck& check, double omega1_rad_s, double omega2_rad_s, double brake_Nm,
                 double lasts_s = dt_s) {
  return check.update({.dt_s = lasts_s,
                       .omega1_rad_s = omega1_rad_s,
                       .omega2_rad_s = omega2_rad_s,
                       .resolution_rad_s = 2.0 * count_rad / lasts_s,
                       .brake_target_Nm = brake_Nm});
}

CheckResult run(EncoderCheck& check, int count, double omega1_rad_s, double omega2_rad_s, double brake_Nm = 0.0) {
  for (int i = 0; i < count; ++i) {
    const CheckResult found = step(check, omega1_rad_s, omega2_rad_s, brake_Nm);
    if (!found.sound()) return found;
  }
  return {};
}

/// The check that both wheels roll, which needs 3 s without the brake, stays silent here: the brake has just let go.
EncoderCheck just_released(double omega2_rad_s) {
  EncoderCheck check(limits());
  CHECK(step(check, 0.0, omega2_rad_s, 1e-3).sound());
  return check;
}

}  // namespace

TEST_CASE("a released wheel stands still for a quarter of a second at most") {
  EncoderCheck check = just_released(100.0);  // the first window of 125
  CHECK(run(check, 123, 0.0, 100.0).sound());
  const CheckResult found = run(check, 2, 0.0, 100.0);
  CHECK(found.reason == Reason::released_wheel_stands);
  CHECK(found.value == Approx(0.25).margin(dt_s));
}

TEST_CASE("only a tread above 1 m/s must spin the released wheel up") {
  EncoderCheck slow = just_released(10.05);  // 0.995 m/s
  CHECK(run(slow, 400, 0.0, 10.05).sound());
  EncoderCheck fast = just_released(10.15);  // 1.005 m/s
  CHECK(run(fast, 200, 0.0, 10.15).reason == Reason::released_wheel_stands);
  // A slower tread in between begins the time anew.
  EncoderCheck between = just_released(10.15);
  CHECK(run(between, 100, 0.0, 10.15).sound());
  CHECK(run(between, 1, 0.0, 10.05).sound());
  const auto windows_until_found = [](EncoderCheck& check) {
    int windows = 1;
    while (windows < 200 && step(check, 0.0, 10.15, 0.0).sound()) ++windows;
    return windows;
  };
  EncoderCheck anew = just_released(10.15);
  CHECK(windows_until_found(between) == windows_until_found(anew) + 1);
}

TEST_CASE("the brake has let go below the torque of a tyre that slides on the least grip") {
  // r1 theta / 8 = 0.0995 * 23 / 8 = 0.28606 N m.
  const auto found = [](double brake_Nm) {
    EncoderCheck check(limits());
    CHECK(run(check, 20, 0.0, 100.0, 3.0).sound());
    return run(check, 1000, 0.0, 100.0, brake_Nm).reason;
  };
  CHECK(found(0.287) == Reason::none);
  CHECK(found(0.285) == Reason::released_wheel_stands);
}

TEST_CASE("more than two counts in all are a wheel that turns") {
  const double one_rad_s = count_rad / dt_s;
  const auto found = [&](double counts) {
    EncoderCheck check = just_released(100.0);
    for (int i = 0; i < 200; ++i) {
      const CheckResult result = step(check, i == 60 ? counts * one_rad_s : 0.0, 100.0, 0.0);
      if (!result.sound()) return i;
    }
    return -1;
  };
  CHECK(found(1.9) == found(0.0));
  CHECK(found(-1.9) == found(0.0));
  CHECK(found(2.1) == found(0.0) + 62);  // anew after window 60, without the first window that just_released took
  CHECK(found(-2.1) == found(0.0) + 62);
  // An encoder that trembles about an edge is stuck; one that creeps on is not.
  EncoderCheck trembles = just_released(100.0);
  Reason reason = Reason::none;
  for (int i = 0; i < 200 && reason == Reason::none; ++i) {
    reason = step(trembles, i % 2 == 0 ? one_rad_s : -one_rad_s, 100.0, 0.0).reason;
  }
  CHECK(reason == Reason::released_wheel_stands);
  EncoderCheck creeps = just_released(100.0);
  for (int i = 0; i < 1000; ++i) CHECK(step(creeps, i % 30 == 0 ? one_rad_s : 0.0, 100.0, 0.0).sound());
}

TEST_CASE("a wheel that was locked by the full brake is never taken for a stuck encoder") {
  // The worst that the bounds allow: a quarter of theta, of which a sliding tyre gives 0.53 (theta sin(C atan(B)), slip
  // 1), and a brake that lets go at half the speed of the nominal lag.
  const rig::RigParameters nominal;
  const double theta_N = 0.25 * nominal.tyre.theta_N;
  const double sliding_Nm = nominal.wheels.r1_m * theta_N * std::sin(nominal.tyre.C * std::atan(nominal.tyre.B));
  const double lasts_s = GENERATE(0.002, 0.005, 0.02, 0.08);
  const double locked_s = GENERATE(0.5, 1.0);
  CAPTURE(lasts_s, locked_s);
  EncoderCheck check(limits());
  double omega1 = 0.0;
  double angle_rad = 0.0;
  double brake_Nm = 0.0;
  double time_s = 0.0;
  std::int64_t counts = 0;
  while (time_s < 2.5 && omega1 < 100.0) {
    const double wanted_Nm = time_s < locked_s ? 9.03 : 0.0;
    if (time_s < locked_s) brake_Nm = 9.03;
    constexpr double fine_s = 1e-5;
    for (double t = 0.0; t < lasts_s; t += fine_s) {
      brake_Nm += 0.5 * nominal.brake.c31_per_s * (wanted_Nm - brake_Nm) * fine_s;
      const double torque_Nm = sliding_Nm - brake_Nm - nominal.wheels.M10_Nm;
      omega1 = std::max(0.0, omega1 + torque_Nm / nominal.wheels.J1_kg_m2 * fine_s);
      angle_rad += omega1 * fine_s;
    }
    const auto before = counts;
    counts = static_cast<std::int64_t>(angle_rad / count_rad);
    const CheckResult found =
        step(check, static_cast<double>(counts - before) * count_rad / lasts_s, 150.0, wanted_Nm, lasts_s);
    CAPTURE(time_s, omega1, brake_Nm);
    REQUIRE(found.sound());
    time_s += lasts_s;
  }
  CHECK(omega1 > 10.0);
}
