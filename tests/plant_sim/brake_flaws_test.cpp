// Rate limit, dead time, hysteresis and other flaws of the brake, in closed form.
#include <cmath>
#include <vector>

#include "abs_hil/plant_sim/plant.hpp"
#include "abs_hil/rig/brake_map.hpp"
#include "catch.hpp"
#include "rigs.hpp"

using namespace abs_hil::plant_sim;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

double static_Nm(const PlantOptions& options, double duty) {
  return abs_hil::rig::brake_torque_at(options.rig.brake, duty);
}

/// The torque after `duration_s` under a duty, in ticks of `tick_s`, which need not divide it.
double torque_after(Plant& plant, double duration_s, double tick_s, double duty) {
  double left_s = duration_s;
  for (; left_s > tick_s; left_s -= tick_s) plant.advance(tick_s, {.brake_duty = duty});
  plant.advance(left_s, {.brake_duty = duty});
  return plant.state().brake_torque_Nm;
}

/// Torque at `time_s` after a step from 0 to `target_Nm`, under the lag c and the limit R of its rate: a ramp until the
/// rest is R/c, then the lag alone.
double limited_step_Nm(double target_Nm, double c_per_s, double limit_Nm_s, double time_s) {
  const double rest_Nm = std::min(target_Nm, limit_Nm_s / c_per_s);
  const double ramp_s = (target_Nm - rest_Nm) / limit_Nm_s;
  return time_s <= ramp_s ? limit_Nm_s * time_s : target_Nm - rest_Nm * std::exp(-c_per_s * (time_s - ramp_s));
}

PlantOptions endless_wheel() {
  PlantOptions options = wheels_apart();
  options.rig.wheels.J1_kg_m2 = 1.0;  // keeps turning
  return options;
}

/// A free wheel that nothing but its brake slows down, with a lag of 1 ms.
PlantOptions fading_alone(double J1_kg_m2, double fading_per_J) {
  PlantOptions options = wheels_apart();
  options.rig.wheels.J1_kg_m2 = J1_kg_m2;
  options.rig.wheels.d1_Nms_rad = options.rig.wheels.M10_Nm = 0.0;
  options.rig.brake.c31_per_s = 1000.0;
  options.brake_flaws.fading_per_J = fading_per_J;
  return options;
}

}  // namespace

TEST_CASE("Under a limit of its rate the brake torque ramps, then follows the lag; on a standing wheel too") {
  PlantOptions options = endless_wheel();
  options.rig.brake.brake_rate_limit_Nm_s = 100.0;
  const double speed_rad_s = GENERATE(0.0, 170.0);
  const double tick_s = GENERATE(1e-3, 0.37e-3, 0.25);
  const double b = static_Nm(options, 1.0);
  const double c = options.rig.brake.c31_per_s;
  REQUIRE(b * c > 100.0);
  // The one integration step with the corner between ramp and lag is off by about c^2 R h^3.
  const double corner_Nm = 2.0 * c * c * 100.0 * std::pow(options.max_step_s, 3);
  for (const double time_s : {0.01, 0.035, 0.05, 0.08, 0.2}) {
    Plant plant(options);
    plant.reset({.omega1_rad_s = speed_rad_s, .omega2_rad_s = speed_rad_s});
    CHECK_THAT(torque_after(plant, time_s, tick_s, 1.0), WithinAbs(limited_step_Nm(b, c, 100.0, time_s), corner_Nm));
  }
}

TEST_CASE("The rate's limit acts on release as on application") {
  PlantOptions options = endless_wheel();
  options.rig.brake.brake_rate_limit_Nm_s = 60.0;
  Plant plant(options);
  plant.reset(rolling_at_170);
  const double held_Nm = torque_after(plant, 2.0, 1e-3, 0.9);
  CHECK_THAT(held_Nm, WithinRel(static_Nm(options, 0.9), 1e-12));
  CHECK_THAT(torque_after(plant, 0.05, 1e-3, 0.0), WithinAbs(held_Nm - 60.0 * 0.05, 1e-9));
}

TEST_CASE("A limit that the lag never meets changes no bit") {
  PlantOptions options = endless_wheel();
  Plant free(options);
  options.rig.brake.brake_rate_limit_Nm_s = 1e6;
  Plant limited(options);
  free.reset(rolling_at_170);
  limited.reset(rolling_at_170);
  for (int tick = 0; tick < 300; ++tick) {
    const double duty = 0.5 + 0.4 * std::sin(0.1 * tick);
    CHECK(torque_after(free, 1e-3, 1e-3, duty) == torque_after(limited, 1e-3, 1e-3, duty));
  }
}

TEST_CASE("After a dead time the torque is that of a brake without one, shifted by it") {
  PlantOptions options = endless_wheel();
  Plant prompt(options);
  const double dead_s = GENERATE(2e-3, 3.7e-3, 0.0203);
  options.rig.brake.brake_dead_time_s = dead_s;
  Plant late(options);
  prompt.reset(rolling_at_170);
  late.reset(rolling_at_170);
  // The prompt brake gets each duty when the late one's dead time has passed.
  const auto duty_at = [](double time_s) { return time_s < 0.0 ? 0.0 : 0.55 + 0.3 * std::sin(40.0 * time_s); };
  constexpr double tick_s = 1e-3;
  const double into_tick_s = dead_s - std::floor(dead_s / tick_s) * tick_s;
  for (int tick = 0; tick < 200; ++tick) {
    const double now_s = tick * tick_s;
    late.advance(tick_s, {.brake_duty = duty_at(now_s)});
    const double whole_s = std::round(std::floor(dead_s / tick_s)) * tick_s;
    if (into_tick_s > 1e-9)
      prompt.advance(into_tick_s, {.brake_duty = duty_at(std::round((now_s - whole_s) / tick_s - 1.0) * tick_s)});
    prompt.advance(tick_s - (into_tick_s > 1e-9 ? into_tick_s : 0.0),
                   {.brake_duty = duty_at(std::round((now_s - whole_s) / tick_s) * tick_s)});
    REQUIRE_THAT(late.state().brake_torque_Nm, WithinAbs(prompt.state().brake_torque_Nm, 1e-9));
  }
  CHECK(late.state().brake_torque_Nm > 0.5);
}

TEST_CASE("A dead time ends within a tick, however long the tick is") {
  PlantOptions options = endless_wheel();
  options.rig.brake.brake_dead_time_s = 0.1;
  Plant plant(options);
  plant.reset(rolling_at_170);
  plant.advance(0.35, {.brake_duty = 0.8});
  const double expected = static_Nm(options, 0.8) * (1.0 - std::exp(-options.rig.brake.c31_per_s * 0.25));
  CHECK_THAT(plant.state().brake_torque_Nm, WithinRel(expected, 1e-9));
}

TEST_CASE("The hysteresis of a cable encloses the area of its closed form") {
  // Slowly up to T and down: (1-h) T*, held at (1-h) T until (1+h) T* is below it, then (1+h) T*. Area (1-h)h/(1+h)
  // T^2.
  constexpr double h = 0.12;
  PlantOptions options = endless_wheel();
  options.rig.brake.u0 = 0.0;
  options.rig.brake.b2_Nm = 0.0;
  options.rig.brake.c31_per_s = 1000.0;
  options.brake_flaws.hysteresis = h;
  Plant plant(options);
  plant.reset({.omega1_rad_s = 1e6, .omega2_rad_s = 1e6});
  const double b1 = options.rig.brake.b1_Nm;
  constexpr int steps = 1000;
  constexpr double most = 0.6;
  double area_Nm2 = 0.0;
  for (int step = 1; step <= 2 * steps; ++step) {
    const double duty = most * (step <= steps ? step : 2 * steps - step) / steps;
    const double before_Nm = plant.state().brake_torque_Nm;
    const double torque_Nm = torque_after(plant, 0.03, 0.03, duty);  // 30 lags: the static torque
    const double target_Nm = b1 * duty;
    if (step <= steps) CHECK_THAT(torque_Nm, WithinRel((1.0 - h) * target_Nm, 1e-9));
    const double change_Nm = b1 * most / steps;
    area_Nm2 += (step <= steps ? -1.0 : 1.0) * 0.5 * (before_Nm + torque_Nm) * change_Nm;
  }
  const double T = b1 * most;
  CHECK_THAT(area_Nm2, WithinRel((1.0 - h) * h / (1.0 + h) * T * T, 1e-5));
  CHECK_THAT(plant.state().brake_torque_Nm, WithinAbs(0.0, 1e-9));  // no torque is left
}

TEST_CASE("A brake fades by the energy that it has taken from its wheel") {
  // T = T0 exp(-k E); without other friction the wheel has lost E = J1 (w0^2 - w^2)/2.
  constexpr double k = 4e-4;
  PlantOptions options = fading_alone(0.2, k);
  const double tick_s = GENERATE(1e-3, 0.4);
  Plant plant(options);
  plant.reset(rolling_at_170);
  const double T0 = static_Nm(options, 0.8);
  const double torque_Nm = torque_after(plant, 2.0, tick_s, 0.8);
  const double w = plant.state().omega1_rad_s;
  const double lost_J = 0.5 * 0.2 * (170.0 * 170.0 - w * w);
  REQUIRE(lost_J > 1000.0);
  // The lag of 1 ms leaves the torque behind by its rate k w T^2 times 1 ms. That a target is held for an integration
  // step leaves 5e-6.
  CHECK_THAT(torque_Nm, WithinRel(T0 * std::exp(-k * lost_J) * (1.0 + k * w * torque_Nm * 1e-3), 2e-5));
  plant.reset(rolling_at_170);
  plant.advance(0.02, {.brake_duty = 0.8});
  CHECK_THAT(plant.state().brake_torque_Nm, WithinRel(T0, 1e-2));  // cold again
}

TEST_CASE("A brake that cools keeps less of the heat by which it fades") {
  // Its wheel turns so fast that the power P = T0 w does not depend on the fading within the digits compared. Braking
  // for t1 leaves E = P (1 - exp(-q t1)) / q; after a rest t2 the share exp(-q t2) of it is left.
  constexpr double q = 0.8;
  constexpr double k = 1e-14;
  PlantOptions options = fading_alone(1.0, k);
  options.brake_flaws.cooling_per_s = q;
  const double tick_s = GENERATE(1e-3, 0.4);
  Plant plant(options);
  constexpr double w = 1e9;
  plant.reset({.omega1_rad_s = w, .omega2_rad_s = w});
  const double T0 = static_Nm(options, 0.8);
  const auto faded = [&](double torque_Nm) { return -std::log(torque_Nm / T0) / k; };
  const double heat_J = T0 * w * (1.0 - std::exp(-q * 2.0)) / q;
  CHECK_THAT(faded(torque_after(plant, 2.0, tick_s, 0.8)), WithinRel(heat_J, 2e-3));
  torque_after(plant, 3.0, tick_s, 0.0);
  // The lag keeps 1 ms of the new power away, and the torque 1 ms behind its target.
  const double again_J = heat_J * std::exp(-q * 3.02) + T0 * w * 0.018;
  CHECK_THAT(faded(torque_after(plant, 0.02, 1e-3, 0.8)), WithinRel(again_J, 3e-3));
}

TEST_CASE("A brake lets go at a rate of its own, within the limit of its rate and after the dead time too") {
  PlantOptions options = endless_wheel();
  const double ratio = GENERATE(0.5, 1.0, 1.8);
  options.brake_flaws.release_ratio = ratio;
  const double dead_s = GENERATE(0.0, 0.0123);
  options.rig.brake.brake_dead_time_s = dead_s;
  const double c = options.rig.brake.c31_per_s;
  const double high_Nm = static_Nm(options, 0.8);
  const double low_Nm = static_Nm(options, 0.5);
  Plant plant(options);
  plant.reset(rolling_at_170);
  const double risen_Nm = torque_after(plant, 0.03, 1e-3, 0.8);
  CHECK_THAT(risen_Nm, WithinRel(high_Nm * (1.0 - std::exp(-c * (0.03 - dead_s))), 1e-9));
  const double held_Nm = torque_after(plant, 3.0, 1e-3, 0.8);
  const double fallen_Nm = torque_after(plant, 0.04, 1e-3, 0.5);
  CHECK_THAT(fallen_Nm, WithinRel(low_Nm + (held_Nm - low_Nm) * std::exp(-ratio * c * (0.04 - dead_s)), 1e-9));
}

TEST_CASE("A brake that lets go sooner than it takes hold loses pulses shorter than the difference") {
  PlantOptions options = endless_wheel();
  options.rig.brake.brake_dead_time_s = 0.0129;
  options.rig.brake.brake_release_lead_s = 0.0037;
  const double c = options.rig.brake.c31_per_s;
  const double b = static_Nm(options, 0.8);
  Plant plant(options);
  plant.reset(rolling_at_170);
  static_cast<void>(torque_after(plant, 0.0036, 1e-3, 0.8));
  CHECK(torque_after(plant, 0.05, 1e-3, 0.0) == 0.0);
  // 30 ms of command brake for 30 - 3.7 ms: from 12.9 to 39.2 ms.
  static_cast<void>(torque_after(plant, 0.03, 1e-3, 0.8));
  CHECK_THAT(torque_after(plant, 0.0092, 1e-3, 0.0), WithinRel(b * (1.0 - std::exp(-c * 0.0263)), 1e-9));
  CHECK_THAT(torque_after(plant, 0.02, 1e-3, 0.0),
             WithinRel(b * (1.0 - std::exp(-c * 0.0263)) * std::exp(-c * 0.02), 1e-9));
}

TEST_CASE("At full duty the torque overshoots as the brake takes hold, and again after it was released for long") {
  PlantOptions options = endless_wheel();
  const double g = 0.74, r = 78.0, c = 340.0;
  // The share that overshoots is held over a step: an error of (r h)^2.
  options.max_step_s = 25e-6;
  options.rig.brake.c31_per_s = c;
  options.rig.brake.brake_dead_time_s = GENERATE(0.0, 0.0129);
  options.brake_flaws.overshoot = g;
  options.brake_flaws.overshoot_per_s = r;
  const double dead_s = options.rig.brake.brake_dead_time_s;
  const double b = static_Nm(options, 1.0);
  // T' = c (b (1 + g s exp(-r t)) - T), T(0) = 0; s is what has come back of the overshoot.
  const auto risen_Nm = [&](double t, double s) {
    return b * (1.0 - std::exp(-c * t) + g * s * c / (c - r) * (std::exp(-r * t) - std::exp(-c * t)));
  };
  for (const double time_s : {0.004, 0.01, 0.04}) {
    Plant plant(options);
    plant.reset(rolling_at_170);
    CHECK_THAT(torque_after(plant, dead_s + time_s, 1e-3, 1.0), WithinRel(risen_Nm(time_s, 1.0), 1e-6));
  }
  Plant plant(options);
  plant.reset(rolling_at_170);
  static_cast<void>(torque_after(plant, 1.0, 1e-3, 1.0));
  static_cast<void>(torque_after(plant, 0.03, 1e-3, 0.0));
  const double left_Nm = b * std::exp(-c * 0.03);
  const double again_Nm = torque_after(plant, dead_s + 0.01, 1e-3, 1.0);
  CHECK_THAT(again_Nm, WithinRel(risen_Nm(0.01, 1.0 - std::exp(-r * 0.03)) + left_Nm * std::exp(-c * 0.01), 1e-6));
  plant.reset(rolling_at_170);
  CHECK_THAT(torque_after(plant, dead_s + 0.01, 1e-3, 0.99),
             WithinRel(static_Nm(options, 0.99) * (1.0 - std::exp(-c * 0.01)), 1e-9));  // none below full duty
}

TEST_CASE("The ripple of the brake's torque does the work of a cosine over the wheel's angle") {
  PlantOptions options = wheels_apart();
  options.rig.wheels.d1_Nms_rad = options.rig.wheels.M10_Nm = 0.0;
  const double R = 1.6, phase = 0.7, J = options.rig.wheels.J1_kg_m2;
  const double duty = GENERATE(0.8, 0.43);
  options.brake_flaws.ripple_Nm = R;
  options.brake_flaws.ripple_phase_rad = phase;
  const double b = static_Nm(options, duty);
  const double amplitude_Nm = R * std::min(b / 3.0, 1.0);
  Plant plant(options);
  plant.reset({.omega1_rad_s = 170.0, .omega2_rad_s = 170.0, .brake_torque_Nm = b});
  for (int tick = 0; tick < 60; ++tick) {
    plant.advance(1e-3, {.brake_duty = duty});
    const PlantState& s = plant.state();
    // J w^2 / 2 falls by the integral of b + A cos(angle + phase) over the angle.
    const double work_J = b * s.angle1_rad + amplitude_Nm * (std::sin(s.angle1_rad + phase) - std::sin(phase));
    REQUIRE_THAT(0.5 * J * s.omega1_rad_s * s.omega1_rad_s, WithinRel(0.5 * J * 170.0 * 170.0 - work_J, 1e-8));
    REQUIRE_THAT(plant.truth().brake_torque_Nm, WithinAbs(b + amplitude_Nm * std::cos(s.angle1_rad + phase), 1e-9));
  }
}

TEST_CASE("A curved map has the torque of the straight one at duty 1, and its share less near 0") {
  PlantOptions options = endless_wheel();
  options.rig.brake.u0 = 0.0;
  options.rig.brake.b2_Nm = 0.0;
  const double k = GENERATE(-0.4, 0.3);
  options.brake_flaws.curvature = k;
  Plant plant(options);
  for (const double duty : {1e-6, 0.5, 1.0}) {
    plant.reset({.omega1_rad_s = 1e6, .omega2_rad_s = 1e6});
    CHECK_THAT(torque_after(plant, 3.0, 0.1, duty),
               WithinRel(static_Nm(options, duty) * (1.0 - k * (1.0 - duty)), 1e-9));
  }
}

TEST_CASE("A copy of a plant has a brake of its own, with what is under way in it") {
  PlantOptions options = endless_wheel();
  options.rig.brake.brake_dead_time_s = 0.05;
  Plant plant(options);
  plant.reset(rolling_at_170);
  plant.advance(0.03, {.brake_duty = 0.8});
  Plant copy = plant;
  plant.advance(0.1, {.brake_duty = 0.8});
  copy.advance(0.02, {});  // releases it 0.05 s later
  copy.advance(0.08, {});
  CHECK_THAT(plant.state().brake_torque_Nm,
             WithinRel(static_Nm(options, 0.8) * (1.0 - std::exp(-options.rig.brake.c31_per_s * 0.08)), 1e-9));
  CHECK(copy.state().brake_torque_Nm > 0.1);
  CHECK(copy.state().brake_torque_Nm < 0.8 * plant.state().brake_torque_Nm);
  copy = plant;
  CHECK(copy.state().brake_torque_Nm == plant.state().brake_torque_Nm);
}

TEST_CASE("An ideal actuator has no flaws") {
  PlantOptions options = endless_wheel();
  options.ideal_actuator = true;
  options.rig.brake.brake_rate_limit_Nm_s = 1.0;
  options.rig.brake.brake_dead_time_s = 0.1;
  options.brake_flaws = {.hysteresis = 0.3,
                         .fading_per_J = 0.01,
                         .cooling_per_s = 1.0,
                         .curvature = 0.5,
                         .release_ratio = 3.0,
                         .overshoot = 1.0,
                         .ripple_Nm = 2.0};
  Plant plant(options);
  plant.reset(rolling_at_170);
  plant.advance(0.01, {.brake_torque_Nm = 3.0});
  CHECK(plant.state().brake_torque_Nm == 3.0);
}

TEST_CASE("The flaws act together with a drifting brake") {
  PlantOptions options = endless_wheel();
  options.rig.brake.brake_dead_time_s = 0.05;
  options.drift.brake_torque = "braking time: 1; 0.5 from 0 to 2";
  Plant plant(options);
  plant.reset(rolling_at_170);
  // Tb' = c (s(t) b - Tb), s = 1 - t/4, from t = 0.05 on: Tb = b (s + 1/(4 c)) + K exp(-c (t - 0.05)).
  const double torque_Nm = torque_after(plant, 0.3, 1e-3, 0.6);
  const double c = options.rig.brake.c31_per_s;
  const double b = static_Nm(options, 0.6);
  const auto slow_part = [&](double t) { return b * (1.0 - 0.25 * t + 0.25 / c); };
  CHECK_THAT(torque_Nm, WithinRel(slow_part(0.3) - slow_part(0.05) * std::exp(-c * 0.25), 1e-6));
}
