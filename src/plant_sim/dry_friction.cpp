#include "dry_friction.hpp"

#include <algorithm>
#include <cmath>

namespace abs_hil::plant_sim {
namespace {

double sign_of(double value) noexcept { return value > 0.0 ? 1.0 : value < 0.0 ? -1.0 : 0.0; }

/// Torque on the standing upper wheel, N m, other than friction.
double pull_on_upper_Nm(const PlantOptions& options, double force_N) noexcept {
  return options.rig.wheels.r1_m * force_N;
}

/// Torque on the standing lower wheel, N m, other than friction.
double pull_on_lower_Nm(const PlantOptions& options, const HeldTorques& held, double force_N) noexcept {
  return motor_torque_Nm(held, 0.0) - options.rig.wheels.r2_m * force_N;
}

/// Friction that holds the standing upper wheel, N m: bearing and brake.
double hold_of_upper_Nm(const PlantOptions& options, const StateVector& x) noexcept {
  return options.rig.wheels.M10_Nm + x[brake_torque];
}

double direction(double speed_rad_s, double pull_Nm, double hold_Nm) noexcept {
  if (speed_rad_s != 0.0) return sign_of(speed_rad_s);
  return std::abs(pull_Nm) <= hold_Nm ? 0.0 : sign_of(pull_Nm);
}

}  // namespace

Sliding sliding_from(const PlantOptions& options, const HeldTorques& held, const StateVector& x) noexcept {
  if (x[omega1] != 0.0 && x[omega2] != 0.0) return {sign_of(x[omega1]), sign_of(x[omega2])};
  const double force_N = tyre_force_N(options, x[omega1], x[omega2]);
  return {direction(x[omega1], pull_on_upper_Nm(options, force_N), hold_of_upper_Nm(options, x)),
          direction(x[omega2], pull_on_lower_Nm(options, held, force_N), options.rig.wheels.M20_Nm)};
}

double margin(const PlantOptions& options, const HeldTorques& held, const Sliding& sliding,
              const StateVector& x) noexcept {
  if (sliding.upper != 0.0 && sliding.lower != 0.0) {
    return std::min(sliding.upper * x[omega1], sliding.lower * x[omega2]);
  }
  const double force_N = tyre_force_N(options, x[omega1], x[omega2]);
  const double upper = sliding.upper != 0.0
                           ? sliding.upper * x[omega1]
                           : hold_of_upper_Nm(options, x) - std::abs(pull_on_upper_Nm(options, force_N));
  const double lower = sliding.lower != 0.0
                           ? sliding.lower * x[omega2]
                           : options.rig.wheels.M20_Nm - std::abs(pull_on_lower_Nm(options, held, force_N));
  return std::min(upper, lower);
}

bool stands_for_good(const PlantOptions& options, const HeldTorques& held, const StateVector& x) noexcept {
  return x[omega1] == 0.0 && x[omega2] == 0.0 &&
         std::abs(pull_on_lower_Nm(options, held, 0.0)) <= options.rig.wheels.M20_Nm;
}

}  // namespace abs_hil::plant_sim
