// Options of the plant outside their range are refused by name.
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>

#include "abs_hil/plant_sim/plant.hpp"
#include "catch.hpp"

using namespace abs_hil::plant_sim;

TEST_CASE("An option outside its range is refused by name") {
  struct Case {
    std::string key;
    std::function<void(PlantOptions&)> spoil;
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const Case cases[] = {
      {"r1_m", [](PlantOptions& o) { o.rig.wheels.r1_m = 0.0; }},
      {"r2_m", [](PlantOptions& o) { o.rig.wheels.r2_m = -0.1; }},
      {"J1_kg_m2", [=](PlantOptions& o) { o.rig.wheels.J1_kg_m2 = nan; }},
      {"J2_kg_m2", [=](PlantOptions& o) { o.rig.wheels.J2_kg_m2 = infinity; }},
      {"d1_Nms_rad", [](PlantOptions& o) { o.rig.wheels.d1_Nms_rad = -1e-9; }},
      {"d2_Nms_rad", [](PlantOptions& o) { o.rig.wheels.d2_Nms_rad = -1e-9; }},
      {"M10_Nm", [](PlantOptions& o) { o.rig.wheels.M10_Nm = -1e-9; }},
      {"M20_Nm", [](PlantOptions& o) { o.rig.wheels.M20_Nm = -1e-9; }},
      {"theta_N", [](PlantOptions& o) { o.rig.tyre.theta_N = 0.0; }},
      {"B", [](PlantOptions& o) { o.rig.tyre.B = 0.0; }},
      {"C", [](PlantOptions& o) { o.rig.tyre.C = 2.01; }},
      {"b1_Nm", [](PlantOptions& o) { o.rig.brake.b1_Nm = 0.0; }},
      {"b2_Nm", [=](PlantOptions& o) { o.rig.brake.b2_Nm = nan; }},
      {"u0", [](PlantOptions& o) { o.rig.brake.u0 = 1.0; }},
      {"c31_per_s", [](PlantOptions& o) { o.rig.brake.c31_per_s = 0.0; }},
      {"motor_stall_torque_Nm", [](PlantOptions& o) { o.rig.motor.stall_torque_Nm = 0.0; }},
      {"motor_no_load_speed_rad_s", [](PlantOptions& o) { o.rig.motor.no_load_speed_rad_s = 0.0; }},
      {"encoder_counts_per_rev", [](PlantOptions& o) { o.rig.encoder_counts_per_rev = 3; }},
      {"slip_regularisation_m_s", [](PlantOptions& o) { o.slip_regularisation_m_s = 0.0; }},
      {"max_step_s", [](PlantOptions& o) { o.max_step_s = 0.0; }},
  };
  for (const Case& c : cases) {
    PlantOptions options;
    c.spoil(options);
    INFO(c.key);
    try {
      const Plant plant(options);
      FAIL("accepted");
    } catch (const std::invalid_argument& error) {
      CHECK_THAT(error.what(), Catch::Matchers::StartsWith("plant." + c.key + " = "));
    }
  }
  CHECK_NOTHROW(Plant{PlantOptions{}});
}
