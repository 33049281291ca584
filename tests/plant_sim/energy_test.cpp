// Without the motor the wheels' kinetic energy never grows, whatever the rig and the brake.
#include <random>

#include "abs_hil/plant_sim/plant.hpp"
#include "brake_profiles.hpp"
#include "catch.hpp"

using namespace abs_hil::plant_sim;

TEST_CASE("Without the motor the kinetic energy never increases, for any rig, state and brake") {
  std::mt19937_64 generator(20240607);
  const auto between = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(generator() >> 11U) * 0x1p-53;
  };
  for (int trial = 0; trial < 300; ++trial) {
    PlantOptions options;
    auto& rig = options.rig;
    rig.wheels.r1_m = between(0.05, 0.3);
    rig.wheels.r2_m = between(0.05, 0.3);
    rig.wheels.J1_kg_m2 = between(1e-3, 0.1);
    rig.wheels.J2_kg_m2 = between(1e-3, 0.1);
    rig.wheels.d1_Nms_rad = between(0.0, 1e-3);
    rig.wheels.d2_Nms_rad = between(0.0, 1e-3);
    rig.wheels.M10_Nm = trial % 5 == 0 ? 0.0 : between(0.0, 0.2);
    rig.wheels.M20_Nm = trial % 7 == 0 ? 0.0 : between(0.0, 0.2);
    rig.tyre = {between(1.0, 80.0), between(2.0, 40.0), between(0.5, 2.0)};
    Plant plant(options);
    const double scale = trial % 3 == 0 ? 0.5 : 150.0;
    plant.reset({.omega1_rad_s = between(-scale, scale),
                 .omega2_rad_s = trial % 4 == 0 ? 0.0 : between(-scale, scale),
                 .brake_torque_Nm = between(0.0, 9.0)});
    INFO("trial " << trial);
    require_energy_never_rises(plant, rig.wheels.J1_kg_m2, rig.wheels.J2_kg_m2, between);
  }
}
