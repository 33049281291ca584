// The observer's gains: the steady state of a Kalman filter, and how late its force is.
#include "control/wheel_force_observer.hpp"

#include <Eigen/LU>
#include <stdexcept>

#include "rig/encoder_scale.hpp"

namespace abs_hil::control {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Gain = Eigen::Matrix<double, 6, 2>;

/// Transition of (angle1, omega1, angle2, omega2, F, D) over `dt`, F and D in units of the rig's scale.
Matrix6 transition(const rig::WheelParameters& w, const RigScale& scale, double dt) {
  Matrix6 rate = Matrix6::Zero();
  rate(0, 1) = rate(2, 3) = 1.0;
  rate(1, 1) = -w.d1_Nms_rad / w.J1_kg_m2;
  rate(1, 4) = w.r1_m * scale.force / w.J1_kg_m2;
  rate(1, 5) = -scale.torque / w.J1_kg_m2;
  rate(3, 3) = -w.d2_Nms_rad / w.J2_kg_m2;
  rate(3, 4) = -w.r2_m * scale.force / w.J2_kg_m2;
  const Matrix6 step = rate * dt;
  return Matrix6::Identity() + step + step * step / 2.0 + step * step * step / 6.0;
}

/// Gain of the steady state of the Riccati recursion.
Gain steady_gain(const Matrix6& A, const Matrix6& Q, double angle_variance) {
  constexpr int recursions = 20'000;
  Eigen::Matrix<double, 2, 6> C = Eigen::Matrix<double, 2, 6>::Zero();
  C(0, 0) = C(1, 2) = 1.0;
  const Eigen::Matrix2d R = angle_variance * Eigen::Matrix2d::Identity();
  Matrix6 P = Matrix6::Identity();
  Gain gain = Gain::Zero();
  for (int i = 0; i < recursions; ++i) {
    const Matrix6 predicted = A * P * A.transpose() + Q;
    const Eigen::Matrix2d innovation = C * predicted * C.transpose() + R;
    const Gain next = predicted * C.transpose() * innovation.inverse();
    P = (Matrix6::Identity() - next * C) * predicted;
    P = (0.5 * (P + P.transpose())).eval();
    const bool settled = (next - gain).cwiseAbs().maxCoeff() < 1e-12 * next.cwiseAbs().maxCoeff();
    gain = next;
    if (settled) break;
  }
  return gain;
}

/// Steady-state lag of the estimate behind a force ramp.
double ramp_delay(const Matrix6& A, const Gain& gain, double dt) {
  // Error e = truth - estimate after each correction: e+ = (1 - K C)(A e + one step of the ramp in F).
  Eigen::Matrix<double, 2, 6> C = Eigen::Matrix<double, 2, 6>::Zero();
  C(0, 0) = C(1, 2) = 1.0;
  const Matrix6 correction = Matrix6::Identity() - gain * C;
  Eigen::Matrix<double, 6, 1> drive = Eigen::Matrix<double, 6, 1>::Zero();
  drive[4] = dt;
  const Eigen::Matrix<double, 6, 1> error =
      (Matrix6::Identity() - correction * A).fullPivLu().solve(correction * drive);
  return error[4];
}

}  // namespace

template <class S>
BasicWheelForceObserver<S>::BasicWheelForceObserver(const ForceObserverOptions<>& options,
                                                    const rig::RigParameters& rig, double rate_Hz)
    : laws_{paper::laws(rig.wheels)} {
  if (!(options.force_rate_N2_s > 0.0 && options.brake_rate_Nm2_s > 0.0 && rate_Hz > 0.0)) {
    throw std::invalid_argument("the force observer's noise intensities and the control rate (Hz) must be > 0");
  }
  const double dt = 1.0 / rate_Hz;
  const RigScale scale = rig_scale(rig.wheels);
  const Matrix6 A = transition(rig.wheels, scale, dt);
  Matrix6 Q = Matrix6::Zero();
  Q(4, 4) = options.force_rate_N2_s * dt;
  Q(5, 5) = options.brake_rate_Nm2_s * dt;
  const double count_rad = rig::radians_per_count(rig.encoder_counts_per_rev);
  const Gain gain = steady_gain(A, Q, count_rad * count_rad / 12.0);
  for (std::size_t i = 0; i != state_.size(); ++i) {
    upper_gain_[i] = gain(static_cast<Eigen::Index>(i), 0);
    lower_gain_[i] = gain(static_cast<Eigen::Index>(i), 1);
  }
  for (auto* gains : {&upper_gain_, &lower_gain_}) {
    (*gains)[force] *= scale.force;
    (*gains)[brake_error] *= scale.torque;
  }
  force_delay_s_ = ramp_delay(A, gain, dt);
}

template class BasicWheelForceObserver<double>;

}  // namespace abs_hil::control
