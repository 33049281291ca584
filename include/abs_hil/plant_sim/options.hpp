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
  double p{2.09945271667129};  ///< in [1, 10]; below 1 the slope at slip 0 would be infinite
};

/// The lever that carries the upper wheel and presses it onto the lower one (Inteco ABS, User's Manual, section 5).
struct LeverParameters {
  double Mg_Nm{19.62};    ///< moment of the lever's weight about its pivot, > 0
  double L_m{0.370};      ///< distance from the pivot to the point of contact, > 0
  double phi_deg{65.61};  ///< angle between the normal in the point of contact and the line L, in (0, 90]
};

/// Time profiles of factors over the plant's parameters, see FactorProfile; empty: constant 1.
struct DriftProfiles {
  std::string brake_torque{};   ///< factor over the torque of the brake's map
  std::string motor_torque{};   ///< factor over the drive motor's torque
  std::string upper_bearing{};  ///< factor over M10 and d1
  std::string lower_bearing{};  ///< factor over M20 and d2
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
  DriftProfiles drift{};                 ///< changes of other parameters during the run
  bool ideal_actuator{false};            ///< the commanded torque acts at once, without map, lag and saturation
  bool ideal_sensors{false};             ///< measurements contain the true speeds
  double slip_regularisation_m_s{0.02};  ///< lower limit of the car speed in the denominator of (5), > 0
  double max_step_s{500e-6};  ///< largest integration step, > 0; tests/plant_sim/accuracy_test.cpp shows the error
};

/// Throws std::invalid_argument with the configuration key, its value and its range if an option is out of range.
void check(const PlantOptions& options);

}  // namespace abs_hil::plant_sim
