#pragma once

#include <span>
#include <string>
#include <vector>

#include "abs_hil/rig/measurement.hpp"
#include "abs_hil/rig/signals.hpp"
#include "abs_hil/rig/state_bytes.hpp"

namespace abs_hil::control {

/// Static torques b(u) on their way through the brake's dead time, as means over equal parts of the time until a torque
/// that is sent now acts, the nearest part first. Empty without dead time. Valid during the call that it is given to.
template <class S>
struct BasicBrakeAhead {
  std::span<const S> torques_Nm{};
  double part_s{0.0};
};

/// Inputs of a slip controller in one cycle. SI units. `S` is a `double` in a run of its own, and a pack of them where
/// many simulated runs are computed side by side (rig/scalar.hpp).
template <class S>
struct BasicSlipInput {
  S dt_s{0.0};                        ///< time since the previous step, > 0; ignored by `reset`
  rig::BasicWheelSpeeds<S> speeds{};  ///< estimated wheel speeds
  S slip{0.0};                        ///< estimated slip (5)
  S slip_ref{0.0};                    ///< reference slip, in (0, 1)
  /// Mean over the past interval of the brake torque estimated to act (the command itself for an ideal actuator), N m.
  S mean_brake_torque_Nm{0.0};
  S brake_torque_Nm{0.0};      ///< brake torque estimated to act now, N m
  S max_brake_torque_Nm{0.0};  ///< largest torque the actuator can give, > 0, may be infinite; the least is 0
  S alpha1_rad_s2{0.0};        ///< estimated acceleration of the upper wheel
  S alpha2_rad_s2{0.0};        ///< estimated acceleration of the lower wheel
  /// Angles turned over the past interval, from the encoders (from the speeds with ideal sensors), rad; NaN if unknown.
  S upper_travel_rad{rig::unknown};
  S lower_travel_rad{rig::unknown};
  /// Once-a-turn error that these angles may have, because the encoders' discs have not been learnt yet, rad; 0:
  /// learnt.
  S disc_error_rad{0.0};
  /// Static torque b(u) that was really sent in the previous cycle, N m: after the PWM's steps, the command gate and
  /// the driver. 0 in the first cycle of a phase.
  S sent_brake_torque_Nm{0.0};
  /// What was missing in it of the controller's previous output, N m: > 0 if less was sent than it asked for (limits,
  /// rate limit, refusal), < 0 if more was sent. 0 if only the PWM's steps and the dead zone part the two, and in the
  /// first cycle of a phase. While it is not 0, an integral that drives the output further out must stand.
  S unsent_torque_Nm{0.0};
  /// What was sent and does not act yet; nothing if the model of the brake has no dead time, or the actuator is ideal.
  BasicBrakeAhead<S> ahead{};
};
using SlipInput = BasicSlipInput<double>;

/// Outputs of a slip controller. The torque is the static torque b(u) of (7); it acts after the lag (6). It may be
/// outside the actuator's range: it is limited afterwards. It must be finite in every cycle. The other outputs may be
/// NaN if they were NaN in the first cycle of the phase, which means that the controller does not give them; they are
/// never infinite. An output that breaks this ends the run with the fault `controller_not_finite` before it acts.
template <class S>
struct BasicSlipOutput {
  S brake_torque_Nm{0.0};
  S slip_velocity_error_m_s{0.0};  ///< e_v of (13)
  S theta_est_N{0.0};              ///< estimated peak tyre force, NaN for controllers that estimate none
  S slip_ref{rig::unknown};        ///< the controller's own slip reference; NaN if it follows that of the input
  /// Values of the controller's own signals, in the order of `SlipController::signals`. The others are ignored.
  rig::SignalValues signals{rig::no_signals};
};
using SlipOutput = BasicSlipOutput<double>;

/// What a braking has left for the next one on the same rig: a key of the configuration and its value.
struct Learnt {
  std::string key;
  double value;
};

/// A slip controller: a pure function of its inputs and its own state. It does not use boards, clocks or files.
/// `reset` and `step` run in the real-time thread: no allocation, lock, system call, exception or log call.
class SlipController {
 public:
  SlipController() = default;
  SlipController(const SlipController&) = delete;
  SlipController& operator=(const SlipController&) = delete;
  virtual ~SlipController() = default;

  /// Starts braking: discards the past and takes the state from this measurement.
  virtual void reset(const SlipInput& input) noexcept = 0;
  /// Computes one control period. The first call is in the same cycle as `reset`, with the same input and dt_s = 0.
  [[nodiscard]] virtual SlipOutput step(const SlipInput& input) noexcept = 0;
  /// The signals that `step` reports besides the fields of SlipOutput, at most `rig::signal_max`. CSV, LCM, `watch` and
  /// the report show them. They may depend on the options, but do not change after construction. By default there are
  /// none. Not called in the real-time thread.
  [[nodiscard]] virtual std::span<const rig::Signal> signals() const noexcept { return {}; }
  /// Takes over the state of `before`, a controller of the same class with other gains, so that gains can change while
  /// braking. Integrals and estimates are kept, and estimates are limited to their new bounds. Returns false and
  /// changes nothing for another class. By default a law cannot take over and returns false.
  [[nodiscard]] virtual bool take_over(const SlipController& before) noexcept;
  /// Writes the whole state, or reads one that a controller of the same class and options has written, so that a
  /// simulation can branch. Returns false and does nothing if the law cannot, as by default. Not called in the
  /// real-time thread.
  [[nodiscard]] virtual bool exchange_state(rig::StateBytes& state);
  /// What the next braking on the same rig may begin with, after one that has stopped the car; by default nothing. Not
  /// called in the real-time thread.
  [[nodiscard]] virtual std::vector<Learnt> learnt() const { return {}; }
};

}  // namespace abs_hil::control
