#pragma once

#include <string>

#include "abs_hil/rig/parameters.hpp"

namespace abs_hil::plant_sim {

/// Coefficients of the maker's friction curve, mu(s) = w4 s^p / (a + s^p) + w3 s^3 + w2 s^2 + w1 s for a slip s in
/// [0, 1] (Inteco ABS, User's Manual, section 5).
struct IntecoMuParameters {
  double w1{-0.04240011450454};
  double w2{2.9375e-10};
  double w3{0.03508217905067};
  double w4{0.40662691102315};
  double a{0.00025724985785};  ///< > 0
  double p{2.09945271667129};  ///< in [1, 10]: below 1 the curve would rise with infinite slope from slip 0
};

/// The lever that carries the upper wheel and presses it on the lower one (Inteco ABS, User's Manual, section 5).
struct LeverParameters {
  double Mg_Nm{19.62};    ///< moment of the lever's weight about its pivot, > 0
  double L_m{0.370};      ///< from the pivot to the point of contact, > 0
  double phi_deg{65.61};  ///< angle between the normal in the point of contact and the line L, in (0, 90]
};

/// Factors over parameters of the plant that go with time, see FactorProfile; empty: 1 throughout.
struct DriftProfiles {
  std::string brake_torque{};   ///< over the torque that the brake's map gives
  std::string motor_torque{};   ///< over the drive motor's torque
  std::string upper_bearing{};  ///< over M10 and d1
  std::string lower_bearing{};  ///< over M20 and d2
};

/// The simulated rig. `rig` holds its true parameters.
struct PlantOptions {
  rig::RigParameters rig{};
  std::string tyre{"magic-formula"};     ///< friction curve: "magic-formula" (4) or "inteco-mu"
  std::string load{"constant"};          ///< normal force: "constant" or "lever"
  double mu_peak{0.4};                   ///< peak of the magic formula's friction curve, used with the lever only, > 0
  IntecoMuParameters inteco_mu{};        ///< for tyre "inteco-mu"
  LeverParameters lever{};               ///< for load "lever"
  std::string friction_profile{};        ///< friction over time or distance, see FactorProfile; empty: none
  DriftProfiles drift{};                 ///< what else changes while it runs
  bool ideal_actuator{false};            ///< the torque asked for acts at once, without map, lag and saturation
  bool ideal_sensors{false};             ///< measurements carry the true speeds
  double slip_regularisation_m_s{0.02};  ///< (5) divides by at least this car speed, > 0
  double max_step_s{500e-6};             ///< largest integration step, > 0; a test shows the error at the default
};

/// Throws std::invalid_argument, naming the configuration key, its value and its range, if an option is outside it.
void check(const PlantOptions& options);

}  // namespace abs_hil::plant_sim
