// EncoderCheck with uncertain stamps, and with wheels that are apart.
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

TEST_CASE("uncertain stamps widen a wheel's speed by their share of the window") {
  // After 100 rad/s the next 10 ms allow down to 100 - s - 2 - 2, where 1 ms of uncertainty makes s = 1 + 100/9.
  const auto doubtful_at = [](double omega_rad_s, double stamp_error_s) {
    SpeedInterval interval(100.0, 200.0, 250.0);
    static_cast<void>(interval.update(100.0, 1.0, 0.01, stamp_error_s));
    static_cast<void>(interval.update(omega_rad_s, 1.0, 0.01, stamp_error_s));
    return interval.doubtful();
  };
  // low is 100 - 12.111 - 2 - 2 = 83.889; 74.6 + 1 + 8.289 = 83.889
  CHECK_FALSE(doubtful_at(74.7, 1e-3));
  CHECK(doubtful_at(74.5, 1e-3));
  // Less than the least uncertainty is no less.
  CHECK(doubtful_at(91.0, 10e-6) == doubtful_at(91.0, 0.0));
  CHECK(doubtful_at(91.2, 10e-6) == doubtful_at(91.2, 0.0));
  // However uncertain the stamps are, no counts are no speed.
  CHECK(doubtful_at(0.0, 2.5e-3));
}

namespace {

/// Speed windows of 5 ms from readings that took 0.6 ms each.
SpeedWindow uncertain(double omega1_rad_s, double omega2_rad_s, double brake_Nm) {
  SpeedWindow w = speed_window(omega1_rad_s, omega2_rad_s, brake_Nm);
  w.dt_s = 5e-3;
  w.resolution_rad_s = 2.0 * 6.283185307179586 / 4096.0 / w.dt_s;
  w.begin_error_s = w.end_error_s = 600e-6;
  return w;
}

/// Number of windows until a fault, and the fault.
std::pair<int, Reason> found_after(double omega1_rad_s, double omega2_rad_s, double brake_Nm, int before = 0) {
  EncoderCheck check(limits());
  for (int i = 0; i < before; ++i) CHECK(check.update(uncertain(0.99 * omega2_rad_s, omega2_rad_s, brake_Nm)).sound());
  for (int i = 1; i <= 200; ++i) {
    const CheckResult found = check.update(uncertain(omega1_rad_s, omega2_rad_s, brake_Nm));
    if (!found.sound()) return {i, found.reason};
  }
  return {0, Reason::none};
}

}  // namespace

TEST_CASE("under uncertain stamps a braked wheel that is ahead is found as soon as the way makes it certain") {
  // With w = 100, k = w1 / w2 and the radii alike, ahead for n windows of 5 ms: k - 1.05 > (k + 1.05) 1.2/(5 n) and
  // the counts' share. k = 1.25: 2.30 1.2/(5 n) < 0.20, n > 2.76, but 0.05 s are 10 windows.
  CHECK(found_after(125.0, 100.0, 3.0, 60).second == Reason::slip_implausible);
  CHECK(found_after(125.0, 100.0, 3.0, 60).first <= 11);
  // 108 rad/s, k = 1.0855 of the treads: 2.1355 * 0.24 / n < 0.0355, and 2 counts more: n > 14.8.
  const auto [windows, reason] = found_after(108.0, 100.0, 3.0, 60);
  CHECK(reason == Reason::slip_implausible);
  CHECK(windows >= 15);
  CHECK(windows <= 16);
  CHECK(found_after(104.0, 100.0, 3.0, 60).second == Reason::none);
}

TEST_CASE("under uncertain stamps wheels that do not roll on each other are found a little later") {
  CHECK(found_after(50.0, 100.0, 0.0).first == 20);  // a tenth of a second
  CHECK(found_after(81.0, 100.0, 0.0).second == Reason::none);
  // 79.9 rad/s: 1.950 m/s apart, 1.846 allowed, and the stamps' 17.85 * 0.24 / n below the rest: n > 41.
  const auto [windows, reason] = found_after(79.9, 100.0, 0.0);
  CHECK(reason == Reason::encoders_disagree);
  CHECK(windows > 38);
  CHECK(windows < 45);
}

TEST_CASE("under uncertain stamps what speaks for a fault wears off while the wheels agree") {
  EncoderCheck rolling(limits());
  for (int i = 0; i < 10; ++i) CHECK(rolling.update(uncertain(70.0, 100.0, 0.0)).sound());
  for (int i = 0; i < 10; ++i) CHECK(rolling.update(uncertain(100.0, 100.0, 0.0)).sound());
  for (int i = 0; i < 19; ++i) CHECK(rolling.update(uncertain(70.0, 100.0, 0.0)).sound());
  EncoderCheck braked(limits());
  for (int i = 0; i < 60; ++i) CHECK(braked.update(uncertain(99.0, 100.0, 3.0)).sound());
  for (int i = 0; i < 7; ++i) CHECK(braked.update(uncertain(109.0, 100.0, 3.0)).sound());
  for (int i = 0; i < 30; ++i) CHECK(braked.update(uncertain(95.0, 100.0, 3.0)).sound());
  for (int i = 0; i < 7; ++i) CHECK(braked.update(uncertain(109.0, 100.0, 3.0)).sound());
}

TEST_CASE("under uncertain stamps a single window that agrees is no proof") {
  // 85 and 100 rad/s differ by less than is allowed, but may differ by more.
  EncoderCheck rolling(limits());
  for (int i = 0; i < 10; ++i) CHECK(rolling.update(uncertain(50.0, 100.0, 0.0)).sound());
  CHECK(rolling.update(uncertain(85.0, 100.0, 0.0)).sound());
  for (int i = 0; i < 8; ++i) CHECK(rolling.update(uncertain(50.0, 100.0, 0.0)).sound());
  const bool found = !rolling.update(uncertain(50.0, 100.0, 0.0)).sound();
  CHECK((found || !rolling.update(uncertain(50.0, 100.0, 0.0)).sound()));
  // 102 and 75 rad/s are behind 105, but may be ahead by the treads' sum of 24 %.
  for (const double behind : {102.0, 75.0}) {
    EncoderCheck braked(limits());
    for (int i = 0; i < 60; ++i) CHECK(braked.update(uncertain(99.0, 100.0, 3.0)).sound());
    for (int i = 0; i < 5; ++i) CHECK(braked.update(uncertain(115.0, 100.0, 3.0)).sound());
    CHECK(braked.update(uncertain(behind, 100.0, 3.0)).sound());
    int more = 0;
    while (more < 20 && braked.update(uncertain(115.0, 100.0, 3.0)).sound()) ++more;
    CHECK(more <= 5);
  }
}

TEST_CASE("wheels that are apart are not compared, but each is still judged alone") {
  const auto parted = [] {
    EncoderCheck check(limits());
    check.note_wheels_apart(true);
    return check;
  };
  // The upper wheel stands, rolls elsewhere, or is ahead while braked: all this is possible.
  for (const auto& [omega1, omega2, brake_Nm] :
       {std::tuple{0.0, 100.0, 0.0}, std::tuple{100.0, 0.0, 0.0}, std::tuple{100.0, 50.0, 2.0}}) {
    CAPTURE(omega1, omega2, brake_Nm);
    EncoderCheck together(limits());
    CHECK_FALSE(run(together, 2000, omega1, omega2, brake_Nm).sound());
    EncoderCheck check = parted();
    CHECK(run(check, 2000, omega1, omega2, brake_Nm).sound());
  }
  // A wheel that stops at once, counts backwards or leaps is impossible in any case.
  for (const auto& [omega1, omega2, reason] :
       {std::tuple{0.0, 100.0, Reason::encoder_upper_stuck}, std::tuple{100.0, 0.0, Reason::encoder_lower_stuck},
        std::tuple{-100.0, 100.0, Reason::encoder_upper_reversed},
        std::tuple{100.0, 200.0, Reason::encoder_lower_jumped}, std::tuple{0.0, 0.0, Reason::encoders_lost}}) {
    CAPTURE(omega1, omega2);
    EncoderCheck check = parted();
    CHECK(run(check, 10, 100.0, 100.0).sound());
    CHECK(run(check, 4, omega1, omega2).reason == reason);
  }
}

TEST_CASE("wheels that were joined are compared again when both have had time to roll") {
  EncoderCheck check(limits());
  check.note_wheels_apart(true);
  CHECK(run(check, 3000, 100.0, 50.0).sound());
  check.note_wheels_apart(false);
  CHECK(run(check, 1499, 100.0, 50.0).sound());  // 3 s
  CHECK(run(check, 45, 100.0, 50.0).sound());    // a disagreement must last 0.1 s
  CHECK(run(check, 10, 100.0, 50.0).reason == Reason::encoders_disagree);

  EncoderCheck braked(limits());
  braked.note_wheels_apart(true);
  CHECK(run(braked, 10, 100.0, 50.0, 2.0).sound());
  braked.note_wheels_apart(false);
  CHECK(run(braked, 1499, 100.0, 50.0, 2.0).sound());
  CHECK(run(braked, 20, 100.0, 50.0, 2.0).sound());  // 0.05 s
  CHECK(run(braked, 10, 100.0, 50.0, 2.0).reason == Reason::slip_implausible);

  // What spoke for a disagreement before they parted does not count.
  EncoderCheck again(limits());
  CHECK(run(again, 45, 75.0, 100.0).sound());
  again.note_wheels_apart(true);
  CHECK(run(again, 10, 75.0, 100.0).sound());
  again.note_wheels_apart(false);
  CHECK(run(again, 1000, 75.0, 100.0).sound());
  again.note_wheels_apart(true);  // once more, before they were compared: the three seconds begin anew
  again.note_wheels_apart(false);
  CHECK(run(again, 1499 + 45, 75.0, 100.0).sound());

  // The check of a standing wheel needs no such time: a tyre that slides on a turning wheel spins it up at once.
  EncoderCheck standing(limits());
  standing.note_wheels_apart(true);
  CHECK(run(standing, 3000, 0.0, 50.0).sound());
  standing.note_wheels_apart(false);
  CHECK(run(standing, 100, 0.0, 50.0).sound());
  standing.note_wheels_apart(true);  // the time for which the wheel stood ends
  standing.note_wheels_apart(false);
  CHECK(run(standing, 123, 0.0, 50.0).sound());
  CHECK(run(standing, 3, 0.0, 50.0).reason == Reason::released_wheel_stands);
}
