#include "plant_sim/dry_friction.hpp"

#include <algorithm>
#include <cmath>

namespace abs_hil::plant_sim {
namespace {

double sign_of(double value) noexcept { return value > 0.0 ? 1.0 : value < 0.0 ? -1.0 : 0.0; }

/// Torque on the standing upper wheel without friction, N m.
double pull_on_upper_Nm(const WheelModel& model, double force_N) noexcept { return model.wheels().r1_m * force_N; }

/// Torque on the standing lower wheel without friction, N m.
double pull_on_lower_Nm(const WheelModel& model, const HeldTorques& held, double force_N) noexcept {
  return motor_torque_Nm(held, 0.0) - model.wheels().r2_m * force_N;
}

/// Largest friction torque on the standing upper wheel, N m: bearing and brake.
double hold_of_upper_Nm(const WheelModel& model, const StateVector& x) noexcept {
  return model.wheels().M10_Nm + x[brake_torque];
}

double direction(double speed_rad_s, double pull_Nm, double hold_Nm) noexcept {
  if (speed_rad_s != 0.0) return sign_of(speed_rad_s);
  return std::abs(pull_Nm) <= hold_Nm ? 0.0 : sign_of(pull_Nm);
}

}  // namespace

Sliding sliding_from(TorqueBalance balance, const StateVector& x) noexcept {
  // Assume first that a standing upper wheel is held. If its friction cannot hold it then, it cannot hold it with the
  // force of the sliding wheel either, which differs for a load that depends on the brake.
  balance.sliding = {sign_of(x[omega1]), sign_of(x[omega2])};
  if (x[omega1] != 0.0 && x[omega2] != 0.0) return balance.sliding;
  const WheelModel& model = balance.model;
  const double force_N = balance.tyre_force_N(x, 0.0);
  return {direction(x[omega1], pull_on_upper_Nm(model, force_N), hold_of_upper_Nm(model, x)),
          direction(x[omega2], pull_on_lower_Nm(model, balance.held, force_N), model.wheels().M20_Nm)};
}

double margin(const TorqueBalance& balance, const StateVector& x, double time_s) noexcept {
  const WheelModel& model = balance.model;
  const Sliding& sliding = balance.sliding;
  const double to_roll_rad = balance.friction.end_angle2_rad - x[angle2];
  if (sliding.upper != 0.0 && sliding.lower != 0.0) {
    return std::min({sliding.upper * x[omega1], sliding.lower * x[omega2], to_roll_rad});
  }
  const double force_N = balance.tyre_force_N(x, time_s);
  const double upper = sliding.upper != 0.0 ? sliding.upper * x[omega1]
                                            : hold_of_upper_Nm(model, x) - std::abs(pull_on_upper_Nm(model, force_N));
  const double lower = sliding.lower != 0.0
                           ? sliding.lower * x[omega2]
                           : model.wheels().M20_Nm - std::abs(pull_on_lower_Nm(model, balance.held, force_N));
  return std::min({upper, lower, to_roll_rad});
}

bool stands_for_good(const WheelModel& model, const HeldTorques& held, const StateVector& x) noexcept {
  return x[omega1] == 0.0 && x[omega2] == 0.0 && std::abs(pull_on_lower_Nm(model, held, 0.0)) <= model.wheels().M20_Nm;
}

}  // namespace abs_hil::plant_sim
