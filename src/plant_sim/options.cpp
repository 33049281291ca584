#include "abs_hil/plant_sim/options.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

namespace abs_hil::plant_sim {
namespace {

void require(bool holds, const char* name, double value, const char* range) {
  if (std::isfinite(value) && holds) return;
  throw std::invalid_argument(std::string("plant.") + name + " = " + std::to_string(value) + ": must be " + range);
}

void require_positive(const char* name, double value) { require(value > 0.0, name, value, "finite and > 0"); }
void require_not_negative(const char* name, double value) { require(value >= 0.0, name, value, "finite and >= 0"); }

}  // namespace

void check(const PlantOptions& options) {
  const rig::WheelParameters& wheels = options.rig.wheels;
  require_positive("r1_m", wheels.r1_m);
  require_positive("r2_m", wheels.r2_m);
  require_positive("J1_kg_m2", wheels.J1_kg_m2);
  require_positive("J2_kg_m2", wheels.J2_kg_m2);
  require_not_negative("d1_Nms_rad", wheels.d1_Nms_rad);
  require_not_negative("d2_Nms_rad", wheels.d2_Nms_rad);
  require_not_negative("M10_Nm", wheels.M10_Nm);
  require_not_negative("M20_Nm", wheels.M20_Nm);

  const rig::TyreParameters& tyre = options.rig.tyre;
  require_positive("theta_N", tyre.theta_N);
  require_positive("B", tyre.B);
  require(tyre.C > 0.0 && tyre.C <= 2.0, "C", tyre.C, "in (0, 2]");

  require_positive("mu_peak", options.mu_peak);

  const IntecoMuParameters& mu = options.inteco_mu;
  require(true, "mu_w1", mu.w1, "finite");
  require(true, "mu_w2", mu.w2, "finite");
  require(true, "mu_w3", mu.w3, "finite");
  require(true, "mu_w4", mu.w4, "finite");
  require_positive("mu_a", mu.a);
  require(mu.p >= 1.0 && mu.p <= 10.0, "mu_p", mu.p, "in [1, 10]");

  require_positive("lever_Mg_Nm", options.lever.Mg_Nm);
  require_positive("lever_L_m", options.lever.L_m);
  require(options.lever.phi_deg > 0.0 && options.lever.phi_deg <= 90.0, "lever_phi_deg", options.lever.phi_deg,
          "in (0, 90]");

  const rig::BrakeParameters& brake = options.rig.brake;
  require_positive("b1_Nm", brake.b1_Nm);
  require(true, "b2_Nm", brake.b2_Nm, "finite");
  require(brake.u0 >= 0.0 && brake.u0 < 1.0, "u0", brake.u0, "in [0, 1)");
  require_positive("c31_per_s", brake.c31_per_s);

  require_positive("motor_stall_torque_Nm", options.rig.motor.stall_torque_Nm);
  require_positive("motor_no_load_speed_rad_s", options.rig.motor.no_load_speed_rad_s);
  require(options.rig.encoder_counts_per_rev >= 4, "encoder_counts_per_rev", options.rig.encoder_counts_per_rev,
          ">= 4");
  require_positive("slip_regularisation_m_s", options.slip_regularisation_m_s);
  require_positive("max_step_s", options.max_step_s);
}

}  // namespace abs_hil::plant_sim
