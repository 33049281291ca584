// The integrator's order, its error at the default step, and its steps near standstill.
#include <algorithm>
#include <cmath>
#include <vector>

#include "abs_hil/plant_sim/plant.hpp"
#include "catch.hpp"
#include "rigs.hpp"

using namespace abs_hil::plant_sim;

namespace {

double speed_difference(const PlantState& a, const PlantState& b) {
  return std::max(std::abs(a.omega1_rad_s - b.omega1_rad_s), std::abs(a.omega2_rad_s - b.omega2_rad_s));
}

PlantState braked_for(double duration_s, double max_step_s) {
  PlantOptions options;
  options.max_step_s = max_step_s;
  Plant plant(options);
  plant.reset(rolling_at_170);
  plant.advance(duration_s, {.brake_duty = 0.505});
  return plant.state();
}

using DutyAtTick = double (*)(int tick);

std::vector<PlantState> braking(const PlantOptions& options, DutyAtTick duty, int ticks) {
  Plant plant(options);
  plant.reset(rolling_at_170);
  std::vector<PlantState> states;
  for (int tick = 0; tick < ticks; ++tick) {
    plant.advance(1e-3, {.brake_duty = duty(tick)});
    states.push_back(plant.state());
  }
  return states;
}

}  // namespace

TEST_CASE("A braking transient converges with the fourth power of the step") {
  // All these steps are below the limit that the slip dynamics set at 170 rad/s, about 2.7 ms.
  const PlantState reference = braked_for(0.128, 20e-6);
  const double coarse = speed_difference(braked_for(0.128, 2e-3), reference);
  const double middle = speed_difference(braked_for(0.128, 1e-3), reference);
  const double fine = speed_difference(braked_for(0.128, 0.5e-3), reference);
  INFO(coarse << " " << middle << " " << fine << " rad/s");
  CHECK(std::log2(coarse / middle) > 3.6);
  CHECK(std::log2(middle / fine) > 3.6);
  CHECK(std::log2(middle / fine) < 4.6);
}

TEST_CASE("The default step leaves an error below 1e-6 rad/s above 1 m/s") {
  const auto [name, duty, ticks] = GENERATE(table<const char*, DutyAtTick, int>({
      {"at the peak of the tyre curve", [](int) { return 0.505; }, 2200},
      {"into a lock", [](int) { return 1.0; }, 2600},
      {"too much, then less", [](int tick) { return tick < 60 ? 0.8 : 0.5; }, 2200},
      {"back and forth", [](int tick) { return (tick / 100) % 2 != 0 ? 0.42 : 0.65; }, 2600},
  }));
  PlantOptions options;
  const std::vector<PlantState> states = braking(options, duty, ticks);
  options.max_step_s = 5e-6;
  const std::vector<PlantState> reference = braking(options, duty, ticks);
  double worst_rad_s = 0.0;
  for (std::size_t i = 0; i < states.size(); ++i) {
    if (reference[i].omega2_rad_s * options.rig.wheels.r2_m < 1.0) break;
    worst_rad_s = std::max(worst_rad_s, speed_difference(states[i], reference[i]));
  }
  INFO(name << ": " << worst_rad_s << " rad/s");
  CHECK(worst_rad_s < 1e-6);
  CHECK(worst_rad_s > 0.0);
}

TEST_CASE("Down to standstill the step shrinks with the speed and the error stays small") {
  PlantOptions options;
  options.ideal_actuator = true;
  const PlantInput input{.brake_torque_Nm = 0.5};
  const PlantState slow{.omega1_rad_s = 20.0, .omega2_rad_s = 20.0};
  Plant plant(options);
  options.max_step_s = 1e-6;
  Plant reference(options);
  plant.reset(slow);
  reference.reset(slow);
  double worst_rad_s = 0.0;
  int ticks = 0;
  while (reference.state().omega2_rad_s > 0.0 && ticks < 2000) {
    plant.advance(1e-3, input);
    reference.advance(1e-3, input);
    worst_rad_s = std::max(worst_rad_s, speed_difference(plant.state(), reference.state()));
    ++ticks;
  }
  INFO(ticks << " ticks, " << worst_rad_s << " rad/s");
  CHECK(ticks < 2000);
  CHECK(worst_rad_s < 1e-5);
}

TEST_CASE("The plant reaches the same state for any division of the time") {
  Plant whole{PlantOptions{}};
  Plant pieces{PlantOptions{}};
  whole.reset(rolling_at_170);
  pieces.reset(rolling_at_170);
  const PlantInput input{.brake_duty = 0.6};
  whole.advance(0.4, input);
  for (int i = 0; i < 1000; ++i) {
    pieces.advance(0.07e-3, input);
    pieces.advance(0.33e-3, input);
  }
  CHECK(speed_difference(whole.state(), pieces.state()) < 1e-6);
  CHECK_THAT(pieces.state().angle2_rad, Catch::Matchers::WithinAbs(whole.state().angle2_rad, 1e-6));
  CHECK_THAT(pieces.state().brake_torque_Nm, Catch::Matchers::WithinAbs(whole.state().brake_torque_Nm, 1e-10));
}

TEST_CASE("A duration of 0 changes nothing") {
  PlantOptions options;
  options.ideal_actuator = true;
  Plant plant(options);
  plant.reset({.angle1_rad = 1.0, .angle2_rad = 2.0, .omega1_rad_s = 3.0, .omega2_rad_s = 4.0, .brake_torque_Nm = 5.0});
  plant.advance(0.0, {.motor_duty = 1.0, .brake_duty = 1.0, .brake_torque_Nm = 7.0});
  CHECK(plant.state().angle1_rad == 1.0);
  CHECK(plant.state().angle2_rad == 2.0);
  CHECK(plant.state().omega1_rad_s == 3.0);
  CHECK(plant.state().omega2_rad_s == 4.0);
  CHECK(plant.state().brake_torque_Nm == 5.0);
}
