#pragma once

#include "abs_hil/control/slip_controller.hpp"
#include "abs_hil/rig/brake_map.hpp"
#include "abs_hil/rig/time_units.hpp"
#include "abs_hil/rig/tyre_curve.hpp"
#include "analysis/braking_figures.hpp"
#include "control/brake_actuator.hpp"
#include "control/speed_tracker.hpp"
#include "experiment/run_logic.hpp"
#include "plant_sim/runge_kutta.hpp"
#include "rig/braking_distance.hpp"
#include "runtime/command_gate.hpp"

/// One braking run in virtual time, from its first cycle to the stop, over a scalar: a `double`, or a pack in which
/// every lane is a run. It consists of the same plant, observers, law, checks and figures as `study::simulate`, and
/// gives the same bits. It knows the undisturbed course of a run only. A run in which anything else happens (a check of
/// the gate looks closer, a limit ends it) says so, and `simulate` has to compute it.
///
/// A run has nothing but scalars as members, so that run and lane have the same words (rig/pack.hpp).
namespace abs_hil::study::lanes {

/// What road and drift make of the rig, as long as it stays as it is: plant_sim::PlantConditions.
template <class S>
struct LaneConditions {
  plant_sim::BasicWheels<S> wheels{};
  S friction{1.0};
  S brake_torque{1.0};
  S steady_to_ns{std::numeric_limits<double>::infinity()};
  S steady_to_angle2_rad{std::numeric_limits<double>::infinity()};
};

/// The rig: plant, encoders, and what the board makes of a duty.
template <class S, class Tyre, class Load>
struct LaneRig {
  Tyre tyre{};
  Load load{};
  LaneConditions<S> now{};
  S max_step_s{0.0};
  rig::BasicBrake<S> brake{};
  plant_sim::BasicState<S> x{};
  S steps{0.0};  ///< of the latest cycle
  S rad_per_count{0.0};
  S upper_offset_rad{0.0};
  S lower_offset_rad{0.0};
  S duty_steps{0.0};

  /// Advances by `duration_s`, to `time_ns`, under a duty of the brake. True where a wheel stands or stops, or road or
  /// drift change: the state is wrong there.
  [[gnu::noinline, gnu::flatten]] auto advance(const S& duration_s, const S& time_ns, const S& duty) noexcept {
    using namespace plant_sim;
    const BrakeAlone<S> held{rig::brake_torque_at(brake, duty) * now.brake_torque, brake.c31_per_s};
    const RollingBalance<S, Tyre, Load, BrakeAlone<S>> balance{tyre, load, now.wheels, held, now.friction};
    steps = steps_for(duration_s, max_step_s, balance.fastest_rate_per_s(x));
    const S step_s = duration_s / steps;
    auto wrong = !(x[omega1] > 0.0 && x[omega2] > 0.0) || time_ns > now.steady_to_ns;
    for (double made = 0.0;; made += 1.0) {
      const auto goes_on = S(made) < steps;
      if (!rig::any(goes_on)) break;
      const BasicState<S> end = runge_kutta_step(balance, x, step_s);
      for (std::size_t i = 0; i < x.size(); ++i) x[i] = rig::select(goes_on, end[i], x[i]);
      wrong = wrong || !(x[omega1] > 0.0 && x[omega2] > 0.0);
    }
    return wrong || x[angle2] > now.steady_to_angle2_rad;
  }
  [[nodiscard]] S counts(const S& angle_rad) const noexcept { return rig::round_down(S(angle_rad / rad_per_count)); }
  [[nodiscard]] S upper_counts() const noexcept { return counts(x[plant_sim::angle1] + upper_offset_rad); }
  [[nodiscard]] S lower_counts() const noexcept { return counts(x[plant_sim::angle2] + lower_offset_rad); }
  [[nodiscard]] S sent_duty(const S& duty) const noexcept {
    return rig::whole_part(S(duty * duty_steps + 0.5)) / duty_steps;
  }
  [[nodiscard]] S v_x_m_s() const noexcept { return now.wheels.r2_m * x[plant_sim::omega2]; }
  [[nodiscard]] S slip() const noexcept { return tyre.slip(S(now.wheels.r1_m * x[plant_sim::omega1]), v_x_m_s()); }
  [[nodiscard]] S peak_force_N() const noexcept {
    const plant_sim::UpperWheelTorques<S, plant_sim::Forwards> torques{
        {}, now.wheels.M10_Nm + x[plant_sim::brake_torque], now.wheels.d1_Nms_rad * x[plant_sim::omega1]};
    return load.force_N(now.friction, torques);
  }
};

/// What of the command gate acts in an undisturbed run: its limits, and whether its checks of the wheels are quiet.
template <class S>
struct LaneGate {
  runtime::WheelWatch<S> watch{};
  runtime::MomentumWatch<S> momentum{};
  runtime::SpeedBounds<S> upper{};
  runtime::SpeedBounds<S> lower{};
  rig::BasicBrake<S> brake{};  ///< of the model
  S rad_per_count{0.0};
  S sure_counts{0.0};
  S window_s{0.0};
  S begin_upper{0.0};  ///< counts at the start of the speed window
  S begin_lower{0.0};
  S brake_impulse_Nms{0.0};
  S overspeed_rad_s{0.0};
  S brake_duty_max{0.0};
  S brake_rate_per_s{0.0};
  S brake_free_duty{0.0};
  S brake_risen{0.0};

  /// Takes the speed window that ends now. True where all checks are quiet.
  [[gnu::noinline, gnu::flatten]] auto quiet(const S& upper_counts, const S& lower_counts) noexcept {
    using Bounds = runtime::SpeedBounds<S>;
    const auto window = runtime::speed_window_over(window_s, rad_per_count, S(upper_counts - begin_upper),
                                                   S(lower_counts - begin_lower), brake_impulse_Nms, S(0.0));
    begin_upper = upper_counts;
    begin_lower = lower_counts;
    brake_impulse_Nms = S(0.0);
    watch.expect_brake(window);
    const auto slack = [&](const S& omega_rad_s) {
      return Bounds::slack_rad_s(omega_rad_s, window.resolution_rad_s, window.dt_s, window.stamp_error_s());
    };
    const auto upper_in_reach = upper.take(window.omega1_rad_s, slack(window.omega1_rad_s), window.dt_s);
    const auto lower_in_reach = lower.take(window.omega2_rad_s, slack(window.omega2_rad_s), window.dt_s);
    const auto ends = momentum.take(window, watch.brake_Nm());
    const auto quiet_wheels = upper_in_reach && lower_in_reach &&
                              watch.quiet_standing(window, S(window.omega1_rad_s * window.dt_s)) &&
                              watch.quiet_rolling(window) && watch.quiet_slip(window);
    return rig::any(ends) ? quiet_wheels && momentum.conclude(ends).quiet() : quiet_wheels;
  }
  [[nodiscard]] S passed_duty(const S& duty, const S& dt_s) noexcept {
    const S within = rig::clamped(duty, S(0.0), brake_duty_max);
    const S most = rig::larger(brake_risen, brake_free_duty) + brake_rate_per_s * dt_s;
    // The first command is not rate-limited.
    return rig::select(dt_s > 0.0 && !(within <= most + runtime::rise_rounding), most, within);
  }
};

/// The phases: slip control until the car is slow, then a constant torque.
template <class S>
struct LaneSequence {
  S slow_m_s{0.0};  ///< car speed that ends slip control when it holds for two samples
  S brake_limit_s{0.0};
  S hold_limit_s{0.0};
  S run_limit_s{0.0};
  S hold_torque_Nm{0.0};
  S was_slow{0.0};  ///< 1 or 0
  S holds{0.0};     ///< 1: slip control has ended
  S hold_since_s{0.0};

  /// True where a limit or standstill ends the phase.
  template <class Condition>
  [[nodiscard]] Condition update(const S& time_s, const S& car_speed_m_s, const Condition& stands_still) noexcept {
    const auto slow = car_speed_m_s < slow_m_s;
    const auto enters = holds == 0.0 && slow && was_slow > 0.0;
    was_slow = rig::select(slow, S(1.0), S(0.0));
    hold_since_s = rig::select(enters, time_s, hold_since_s);
    holds = rig::select(enters, S(1.0), holds);
    const auto holding = holds > 0.0;
    return time_s > run_limit_s || (!holding && time_s > brake_limit_s) ||
           (holding && !enters && (stands_still || time_s - hold_since_s > hold_limit_s));
  }
};

template <class S, template <class> class Law, template <class> class Tyre, template <class> class Load>
struct BrakingRun {
  using Scalar = S;
  using Condition = decltype(S(0.0) < S(0.0));

  LaneRig<S, Tyre<S>, Load<S>> rig{};
  LaneGate<S> gate{};
  LaneSequence<S> sequence{};
  Law<S> law{};
  control::SpeedTracker<S> upper{};
  control::SpeedTracker<S> lower{};
  control::BasicBrakeActuator<S> actuator{};
  analysis::BrakingFigures<S> figures{};
  rig::BrakingDistance<S> distance{};
  S r1_m{0.0};  ///< of the model
  S r2_m{0.0};
  S slip_ref{0.0};
  S period_s{0.0};
  S period_ns{0.0};
  S time_ns{0.0};
  S upper_counts{0.0};
  S lower_counts{0.0};
  S upper_travel{0.0};  ///< counts over the past cycle
  S lower_travel{0.0};
  S duty{0.0};  ///< sent to the board
  S sent_Nm{0.0};
  S unsent_Nm{0.0};
  S complete{0.0};   ///< 1: the figures are complete
  S disturbed{0.0};  ///< 1: `simulate` has to compute the run

  /// The first cycle: both wheels turn at this speed, and the controller begins.
  void begin(const S& start_speed_rad_s) noexcept {
    rig.x[plant_sim::omega1] = rig.x[plant_sim::omega2] = start_speed_rad_s;
    upper_counts = gate.begin_upper = rig.upper_counts();
    lower_counts = gate.begin_lower = rig.lower_counts();
    upper.reset(start_speed_rad_s);
    lower.reset(start_speed_rad_s);
    actuator.reset();
    decide(S(0.0), true);
  }
  /// Every later cycle.
  /// @param window_ends  the gate's speed window ends with it
  /// @param assist  called as assist(where, before) if a wheel stands or stops, or road or drift change: it has to set
  ///   the plant's state and conditions there, from the state before the cycle
  template <class Assist>
  void cycle(bool window_ends, const Assist& assist) noexcept {
    time_ns += period_ns;
    const plant_sim::BasicState<S> before = rig.x;
    if (const Condition wrong = rig.advance(period_s, time_ns, duty); rig::any(wrong)) assist(wrong, before);
    // With a lever the peak force depends on whether the brake holds the wheel.
    if constexpr (Load<S>::knows_sliding) disturb(!(rig.x[plant_sim::omega1] > 0.0));
    observe(window_ends);
    decide(period_s, false);
  }

 private:
  void disturb(const Condition& where) noexcept { disturbed = rig::select(where, S(1.0), disturbed); }

  /// Reads the encoders, and asks the gate whether all is quiet.
  [[gnu::noinline, gnu::flatten]] void observe(bool window_ends) noexcept {
    constexpr double near_wrap = 2e9;
    const S upper_now = rig.upper_counts();
    const S lower_now = rig.lower_counts();
    upper_travel = upper_now - upper_counts;
    lower_travel = lower_now - lower_counts;
    upper_counts = upper_now;
    lower_counts = lower_now;
    gate.brake_impulse_Nms += rig::brake_torque_at(gate.brake, duty) * period_s;
    disturb(rig::magnitude(upper_travel) > gate.sure_counts || rig::magnitude(lower_travel) > gate.sure_counts ||
            rig::magnitude(upper_now) > near_wrap || rig::magnitude(lower_now) > near_wrap);
    if (window_ends) disturb(!gate.quiet(upper_now, lower_now));
    upper.take(upper_travel);
    lower.take(lower_travel);
    actuator.advance(period_s);
  }
  /// Phase, law and gate, from the estimates to the duty, and the figures of the cycle.
  void decide(const S& dt_s, bool begins) noexcept;

  [[gnu::noinline, gnu::flatten]] static control::BasicSlipOutput<S> ask(Law<S>& law,
                                                                         const control::BasicSlipInput<S>& input,
                                                                         bool begins) noexcept {
    if (begins) law.reset(input);
    return law.step(input);
  }
  [[gnu::noinline, gnu::flatten]] void send(const S& wanted_Nm, const S& dt_s, const Condition& braking,
                                            analysis::BrakingSample<S>& sample) noexcept;
};

template <class S, template <class> class Law, template <class> class Tyre, template <class> class Load>
void BrakingRun<S, Law, Tyre, Load>::decide(const S& dt_s, bool begins) noexcept {
  const S time_s = time_ns * rig::s_per_ns;
  const S omega1_rad_s = upper.omega_rad_s();
  const S omega2_rad_s = lower.omega_rad_s();
  const S slip = rig::wheel_slip(S(r1_m * omega1_rad_s), S(r2_m * omega2_rad_s), S(experiment::slip_floor_m_s));
  disturb(sequence.update(time_s, S(r2_m * omega2_rad_s), upper.stands_still() && lower.stands_still()));
  const Condition braking = sequence.holds == 0.0;
  const control::BasicSlipInput<S> input{.dt_s = dt_s,
                                         .speeds = {omega1_rad_s, omega2_rad_s},
                                         .slip = slip,
                                         .slip_ref = slip_ref,
                                         .mean_brake_torque_Nm = actuator.mean_torque_Nm(),
                                         .brake_torque_Nm = actuator.torque_Nm(),
                                         .max_brake_torque_Nm = actuator.max_torque_Nm(),
                                         .alpha1_rad_s2 = upper.alpha_rad_s2(),
                                         .alpha2_rad_s2 = lower.alpha_rad_s2(),
                                         .upper_travel_rad = upper_travel * gate.rad_per_count,
                                         .lower_travel_rad = lower_travel * gate.rad_per_count,
                                         .sent_brake_torque_Nm = sent_Nm,
                                         .unsent_torque_Nm = unsent_Nm};
  const control::BasicSlipOutput<S> output = ask(law, input, begins);
  // A controller's output must be finite, and what the gate sees too. Numbers that large are no part of a sound run.
  constexpr double sound = 1e30;
  const S theta_N = Law<S>::estimates_theta ? output.theta_est_N : S(0.0);
  disturb(!(rig::magnitude(output.brake_torque_Nm) < sound && rig::magnitude(output.slip_velocity_error_m_s) < sound &&
            rig::magnitude(theta_N) < sound && rig::magnitude(omega1_rad_s) <= gate.overspeed_rad_s &&
            rig::magnitude(omega2_rad_s) <= gate.overspeed_rad_s));
  analysis::BrakingSample<S> sample{.time_s = time_s,
                                    .v_x_m_s = rig.v_x_m_s(),
                                    .slip = rig.slip(),
                                    .slip_ref = rig::select(rig::is_nan(output.slip_ref), slip_ref, output.slip_ref),
                                    .theta_est_N = output.theta_est_N,
                                    .theta_N = rig.peak_force_N()};
  send(rig::select(braking, output.brake_torque_Nm, sequence.hold_torque_Nm), dt_s, braking, sample);
}

template <class S, template <class> class Law, template <class> class Tyre, template <class> class Load>
void BrakingRun<S, Law, Tyre, Load>::send(const S& wanted_Nm, const S& dt_s, const Condition& braking,
                                          analysis::BrakingSample<S>& sample) noexcept {
  const auto target = actuator.next(wanted_Nm, dt_s);
  sample.torque_ref_Nm = target.torque_Nm;
  const S passed = gate.passed_duty(target.duty, dt_s);
  duty = rig.sent_duty(passed);
  gate.brake_risen = rig::smaller(passed, S(duty + runtime::rounded_down_most));
  actuator.command(duty, target.torque_Nm);
  sent_Nm = actuator.static_torque_Nm(duty, target.torque_Nm);
  unsent_Nm = rig::select(braking, actuator.unsent_Nm(wanted_Nm, target.torque_Nm, sent_Nm), S(0.0));

  distance.note(sample.time_s, sample.v_x_m_s, braking);
  sample.distance_m = distance.distance_m();
  figures.note(sample, braking);
  complete = rig::select(!braking && figures.stop_known(), S(1.0), complete);
}

}  // namespace abs_hil::study::lanes
