// Brakes at the unknown peak of friction with as little motion of the brake as possible.
#pragma once

#include <array>
#include <vector>

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "abs_hil/rig/brake_map.hpp"
#include "abs_hil/rig/tyre_curve.hpp"
#include "control/classic_controllers.hpp"
#include "control/friction_bank.hpp"
#include "control/law_controller.hpp"
#include "control/state_predictor.hpp"
#include "control/wheel_force_observer.hpp"
#include "control/wheel_motion.hpp"

namespace abs_hil::control {

/// Torque that brings e_v' = (r1/J1) (T - hold) to e_v = 0 with a brake that is slow: near the target in proportion to
/// the error, far from it almost as fast as the brake can (proximate time-optimal control, Workman 1987). While the
/// torque returns to `hold` at the rate a, the error moves on by z^2 / (2 a J1/r1) for an excess z. So z =
/// sqrt(2 a (J1/r1) |e|) is the largest excess from which the error still ends at 0.
template <class S>
struct BasicProximateTorque {
  S mass_kg_m{0.0};        ///< J1/r1
  S gain_per_s{0.0};       ///< decay of a large error
  S near_per_s{0.0};       ///< decay of a small error
  S near_m_s{0.0};         ///< error at which the gain is half way between; > 0
  S swing_per_s{0.0};      ///< the brake's c31
  S rate_limit_Nm_s{0.0};  ///< of the brake; may be infinite

  /// Excess over the holding torque, as a size.
  /// @param error_m_s  size of e_v
  /// @param room_Nm  from the holding torque to the end of the range that the torque must use to return, > 0
  /// @param authority  part of the limit that is used, in (0, 1]
  [[nodiscard]] S excess_Nm(const S& error_m_s, const S& room_Nm, const S& authority) const noexcept {
    const S gain = near_per_s + (gain_per_s - near_per_s) * error_m_s / (error_m_s + near_m_s);
    const S rate = rig::smaller(S(swing_per_s * room_Nm), rate_limit_Nm_s);
    return rig::smaller(S(gain * mass_kg_m * error_m_s),
                        S(authority * rig::square_root(S(2.0 * rate * mass_kg_m * error_m_s))));
  }
};
using ProximateTorque = BasicProximateTorque<double>;

/// Brakes at the slip of the largest tyre force, and moves the brake as little as that allows. It needs neither theta,
/// B and C nor a slip reference (docs/theory-beyond.md). FrictionBank learns the curve from the lower wheel's force.
/// The torque that holds a slip follows from the curve and from the error that the balance of both wheels shows. The
/// loop is proximate time-optimal through the brake's lag and rate limit. Changes below `play_Nm` are not sent. It does
/// not use `rig.tyre`. theta_est_N is the estimated peak force, and slip_ref is the controller's own reference.
template <class S>
class AdaptiveOptimalLaw {
 public:
  static constexpr bool estimates_theta = true;

  AdaptiveOptimalLaw() = default;
  explicit AdaptiveOptimalLaw(const ControllerContext& context);

  void reset(const BasicSlipInput<S>& input) noexcept;
  [[nodiscard]] BasicSlipOutput<S> step(const BasicSlipInput<S>& input) noexcept;
  static constexpr std::array<rig::Signal, 3> signals{{
      {"peak_slip", "estimated slip of the largest tyre force"},
      {"slip_zero", "estimated error of the slip: the true one less the one that is read"},
      {"friction_jumps", "jumps of friction seen since braking began"},
  }};
  void show(BasicSlipOutput<S>& output) const noexcept {
    output.signals[0] = bank_.peak_slip();
    output.signals[1] = bank_.slip_zero();
    output.signals[2] = bank_.jumps();
  }
  [[nodiscard]] std::vector<Learnt> learnt() const {
    return {{"control.adaptive_optimal.last_peak_slip", bank_.learnt_peak_slip()}};
  }
  /// Lanes learn in every cycle.
  [[nodiscard]] bool has_lanes() const noexcept { return learns_every_ <= 1.0; }

 private:
  using Bank = BasicFrictionBank<S>;
  using Speeds = rig::BasicWheelSpeeds<S>;

  /// What the loop acts on: the state as a command that is sent now begins to act.
  struct Situation {
    ActingState<S> state;
    S slip;
    S force_N;  ///< that the bank expects there
  };
  /// The torques that hold the slip: as it is wanted, and as it is.
  struct Holding {
    S wanted_Nm;
    S here_Nm;
  };
  /// Cycles since the bank last learnt.
  struct Unlearnt {
    S cycles{0.0};
    S time_s{0.0};
    S upper_rad{0.0}, lower_rad{0.0};  ///< travel of both wheels
  };

  [[nodiscard]] S slip_of(const Speeds& speeds) const noexcept;
  void learn(const BasicSlipInput<S>& input, const S& slip) noexcept;
  [[nodiscard]] typename Bank::Swing swing(const S& disc_error_rad, const S& omega_rad_s) const noexcept;
  [[nodiscard]] Situation ahead(const BasicSlipInput<S>& input, const S& slip) const noexcept;
  [[nodiscard]] S peak_factor() const noexcept;
  [[nodiscard]] S near_gain_per_s() const noexcept;
  [[nodiscard]] S search_part() const noexcept;
  [[nodiscard]] S next_reference(const S& dt_s) noexcept;
  [[nodiscard]] S holding_torque_Nm(const Speeds& speeds, const S& slip, const S& force_N) const noexcept;
  [[nodiscard]] Holding holding(const Situation& here, const S& reference, const S& error_m_s) const noexcept;
  [[nodiscard]] S dared_torque_Nm(const typename Bank::Force& wanted, const S& wanted_Nm,
                                  const Situation& here) const noexcept;
  [[nodiscard]] S wanted_torque_Nm(const Holding& hold, const S& error_m_s, const S& most_Nm) const noexcept;
  [[nodiscard]] S through_lag_Nm(const S& torque_Nm, const S& wanted_Nm) const noexcept;
  [[nodiscard]] S with_play_Nm(const S& torque_Nm, const S& most_Nm) noexcept;

  AdaptiveOptimalOptions<S> options_{};
  paper::Laws<S> laws_{};
  rig::BasicBrake<S> brake_{};
  BasicBrakeLag<S> lag_{};
  BasicStatePredictor<S> predictor_{};
  S dead_time_s_{0.0}, torque_scale_{1.0};
  S period_s_{0.0};
  S v_min_m_s_{0.0};
  BasicProximateTorque<S> loop_{};
  BasicWheelForceObserver<S> observer_{};
  BasicLowerWheelForce<S> force_{};
  BasicDelayedSpeeds<S> speeds_{};
  S early_part_{0.0};    ///< amplitude of the early search at its start, as a part of the reference
  S learns_every_{1.0};  ///< cycles
  S step_s_{0.0};        ///< time of the last step of learning, and what of its distance the model's error covers then
  S error_covered_{0.0};
  S cycle_s_{0.0};  ///< time of the last cycle, and the largest factor of the reference in it
  S largest_rise_{1.0};
  S braked_s_{0.0};  ///< time since braking began
  Bank bank_{};
  S reference_{0.0};       ///< slip of the peak, without search and zero
  S model_error_Nm_{0.0};  ///< of the holding torque: what is missing in it
  S sent_Nm_{0.0};
  S search_rad_{0.0};  ///< angle of the search, in [-pi, pi]
  Speeds last_speeds_{};
  Unlearnt unlearnt_{};
};

}  // namespace abs_hil::control

#include "control/adaptive_optimal_law.hpp"
