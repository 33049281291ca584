// The normal force by the lever: its value by hand, its bounds, where a held wheel breaks away.
#include "abs_hil/plant_sim/load_models.hpp"

#include <cmath>
#include <stdexcept>

#include "catch.hpp"
#include "rigs.hpp"

using namespace abs_hil::plant_sim;
using Catch::Matchers::Contains;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

const double phi = 65.61 * std::acos(-1.0) / 180.0;

PlantState turning(double omega1_rad_s, double omega2_rad_s, double brake_torque_Nm) {
  return {.omega1_rad_s = omega1_rad_s, .omega2_rad_s = omega2_rad_s, .brake_torque_Nm = brake_torque_Nm};
}

double force_N(const PlantOptions& options, const PlantState& state) {
  Plant plant(options);
  plant.reset(state);
  return plant.tyre_force_N();
}

}  // namespace

TEST_CASE("The lever's normal force, by hand: it rises with the brake torque and falls off in traction") {
  // Fn = (19.62 + 4 + 0.0032 + 1.1874e-4 * 150) / (0.37 (sin 65.61 - 0.394847 cos 65.61)) = 85.454 N at slip 0.15.
  const double omega2 = 0.0995 * 150.0 / 0.85 / 0.0990;
  CHECK_THAT(force_N(inteco_manual(), turning(150.0, omega2, 4.0)), WithinRel(33.74139246815038, 1e-12));
  // The same slip in traction: sin + mu cos, and the force drives the other way.
  CHECK_THAT(force_N(inteco_manual(), turning(150.0, 0.0995 * 150.0 * 0.85 / 0.0990, 4.0)),
             WithinRel(-23.494575237986638, 1e-12));
  // 1 N m more of brake torque: 1/23.641 more force.
  const double more = force_N(inteco_manual(), turning(150.0, omega2, 5.0));
  CHECK_THAT(more / 33.74139246815038, WithinRel(1.0 + 1.0 / 23.641011, 1e-8));
}

TEST_CASE("A wheel turning backward lifts the lever with its brake torque, at most to zero force") {
  // s1 = -1: the numerator is 19.62 - M1 - M10 - d1 |w1|; slip 1 in opposite ways, s = +1.
  const double arm = 0.37 * (std::sin(phi) - 0.3992043980505987 * std::cos(phi));
  CHECK_THAT(force_N(inteco_manual(), turning(-10.0, 100.0, 9.0)),
             WithinRel(0.3992043980505987 * (19.62 - 9.0 - 0.0032 - 1.1874e-3) / arm, 1e-12));
  CHECK(force_N(inteco_manual(), turning(-10.0, 100.0, 25.0)) == 0.0);
}

TEST_CASE("A wheel that its brake holds transmits the tyre's torque, not the largest brake torque") {
  // Fn (L (sin phi - mu cos phi) - r1 mu) = Mg: 83.0426 N, F = 33.1510 N, whatever the brake torque beyond r1 F.
  const double torque_Nm = GENERATE(3.4, 5.0, 9.03, 50.0);
  CHECK_THAT(force_N(inteco_manual(), turning(0.0, 100.0, torque_Nm)), WithinRel(33.15095163929526, 1e-12));
  // Dragged backward it lifts the lever: Fn (L (sin phi + mu cos phi) + r1 mu) = Mg.
  const double arm = 0.37 * (std::sin(phi) + 0.3992043980505987 * std::cos(phi)) + 0.0995 * 0.3992043980505987;
  CHECK_THAT(force_N(inteco_manual(), turning(0.0, -100.0, torque_Nm)),
             WithinRel(-0.3992043980505987 * 19.62 / arm, 1e-12));
}

TEST_CASE("The force does not jump where a held wheel breaks away") {
  // It breaks away at M10 + M1 = r1 F = 3.298520 N m.
  const double hold_Nm = 0.0995 * 33.15095163929526 - 0.0032;
  const double held_N = force_N(inteco_manual(), turning(0.0, 100.0, hold_Nm + 1e-9));
  const double sliding_N = force_N(inteco_manual(), turning(0.0, 100.0, hold_Nm - 1e-9));
  CHECK_THAT(held_N, WithinRel(sliding_N, 1e-8));
  CHECK(force_N(inteco_manual(), turning(0.0, 100.0, hold_Nm - 1.0)) < held_N - 1.0);
}

TEST_CASE("The truth's theta is the largest braking force of any slip at the present brake torque") {
  Plant plant(inteco_manual());
  const double torque_Nm = GENERATE(0.0, 4.0, 9.0);
  double largest_N = 0.0;
  for (int i = 0; i <= 1000; ++i) {
    const double slip = 0.999999 * i / 1000.0;
    plant.reset(turning(10.0, 10.0 * 0.0995 / 0.0990 / (1.0 - slip), torque_Nm));
    largest_N = std::max(largest_N, plant.tyre_force_N());
  }
  CHECK_THAT(plant.truth().theta_N, WithinRel(largest_N, 1e-6));
}

TEST_CASE("No load rises more steeply with friction than its bound") {
  PlantOptions options = inteco_manual();
  options.load = GENERATE("constant", "lever");
  const LoadModel model = make_load_model(options, 0.4, 1.5);
  using Torques = UpperWheelTorques<double, double>;
  const Torques torques =
      GENERATE(Torques{1.0, 9.0, 0.02}, Torques{0.0, 9.0, 0.0}, Torques{-1.0, 9.0, -0.02}, Torques{1.0, 0.0, 0.0});
  std::visit(
      [&](const auto& load) {
        double steepest_N = 0.0;
        for (int i = -1500; i < 1500; ++i) {
          const double rise_N = load.force_N(0.5, 2e-3 * (i + 1), torques) - load.force_N(0.5, 2e-3 * i, torques);
          steepest_N = std::max(steepest_N, rise_N / 1e-3);
        }
        CHECK(steepest_N <= load.steepest_N(1.5, torques) * (1.0 + 1e-9));
        CHECK(steepest_N > 0.99 * load.steepest_N(1.5, torques));
      },
      model);
}

TEST_CASE("Tyres and loads combine freely") {
  const double omega2 = 0.0995 * 150.0 / 0.85 / 0.0990;  // slip 0.15
  const PlantState state = turning(150.0, omega2, 4.0);
  PlantOptions options = inteco_manual();
  options.load = "constant";  // then theta_N is the peak
  CHECK_THAT(force_N(options, state), WithinRel(34.31 * 0.3948472925401165 / 0.3992043980505987, 1e-12));
  options.tyre = "magic-formula";
  options.load = "lever";
  options.mu_peak = 0.35;
  const double mu = 0.35 * std::sin(1.2694 * std::atan(19.49 * 0.15));
  CHECK_THAT(
      force_N(options, state),
      WithinRel(mu * (19.62 + 4.0032 + 1.1874e-4 * 150.0) / (0.37 * (std::sin(phi) - mu * std::cos(phi))), 1e-10));
}

TEST_CASE("A lever that friction would wedge and an unknown load are refused") {
  PlantOptions options = inteco_manual();
  options.friction_profile = "time: 1; 4 at 1";
  CHECK_THROWS_WITH(Plant(options), Contains("plant.load = \"lever\": a friction coefficient of 1.59") &&
                                        Contains("would wedge") && Contains("at most 1.2"));
  options.load = "constant";
  CHECK_NOTHROW(Plant(options));
  options.load = "spring";
  CHECK_THROWS_WITH(Plant(options), Contains("plant.load = \"spring\" is not valid; give one of constant, lever"));
}
