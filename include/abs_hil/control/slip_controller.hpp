#pragma once

#include "abs_hil/rig/measurement.hpp"

namespace abs_hil::control {

/// What a slip controller sees in one cycle. SI units.
struct SlipInput {
  double dt_s{0.0};           ///< time since the previous step, > 0; ignored by `reset`
  rig::WheelSpeeds speeds{};  ///< estimated wheel speeds
  double slip{0.0};           ///< estimated slip (5)
  double slip_ref{0.0};       ///< wanted slip, in (0, 1)
  /// Mean over the past interval of the brake torque estimated to act (the command itself for an ideal actuator), N m.
  double mean_brake_torque_Nm{0.0};
  double brake_torque_Nm{0.0};      ///< brake torque estimated to act now, N m
  double max_brake_torque_Nm{0.0};  ///< largest torque the actuator can give, > 0, may be infinite; the least is 0
  double alpha1_rad_s2{0.0};        ///< estimated acceleration of the upper wheel
  double alpha2_rad_s2{0.0};        ///< estimated acceleration of the lower wheel
  /// Angles turned over the past interval, by the encoders (by the speeds, where those are ideal), rad; NaN if unknown.
  double upper_travel_rad{rig::unknown};
  double lower_travel_rad{rig::unknown};
};

/// What a slip controller wants. The torque is the static one, b(u) of (7), asked of the actuator: behind the lag (6)
/// it acts later. It may lie outside what the actuator can give: it is limited afterwards.
struct SlipOutput {
  double brake_torque_Nm{0.0};
  double slip_velocity_error_m_s{0.0};  ///< e_v of (13)
  double theta_est_N{0.0};              ///< estimated peak tyre force, NaN for controllers that estimate none
  double slip_ref{rig::unknown};        ///< slip that it follows, if it chooses it itself; NaN: that of the input
};

/// A slip controller: a pure function of its inputs and its own state, which knows nothing of boards, clocks and files.
/// `reset` and `step` run in the real-time thread: no allocation, lock, system call, exception or log call.
class SlipController {
 public:
  SlipController() = default;
  SlipController(const SlipController&) = delete;
  SlipController& operator=(const SlipController&) = delete;
  virtual ~SlipController() = default;

  /// Start of braking: forget the past and take the state from this measurement.
  virtual void reset(const SlipInput& input) noexcept = 0;
  /// One control period. Called for the first time in the same cycle as `reset`, with the same input and dt_s = 0.
  [[nodiscard]] virtual SlipOutput step(const SlipInput& input) noexcept = 0;
  /// Goes on from where `before` stands, a controller of the same class with other gains: integrals and estimates are
  /// kept (an estimate within its new bounds), so that gains can be changed while it brakes. False, and nothing
  /// changed, for another class; the default for laws that cannot do so.
  [[nodiscard]] virtual bool take_over(const SlipController& before) noexcept;
};

inline bool SlipController::take_over(const SlipController& /*before*/) noexcept { return false; }

}  // namespace abs_hil::control
