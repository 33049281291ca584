// One braking run in virtual time, from its first cycle to the stop, over a scalar S: a `double`, or a pack in which
// every lane is a run. Each cycle of h seconds, as `study::simulate` computes it and with its bits:
//
//   1. plant     LaneRig::advance over h under the duty u that was sent
//   2. speeds    omega1, omega2 from the counters (SpeedTracker), slip = 1 - r1 omega1 / (r2 omega2), regularised (5)
//   3. sequence  slip control until r2 omega2 < slow speed in two samples in a row, then a constant torque
//   4. law       wanted torque from slip, speeds and the estimated torque
//   5. gate      u = min(wanted duty, largest duty, max(last u, free duty) + rate h), u >= 0; checks of the wheels
//   6. figures   BrakingFigures of the cycle
//
// LaneRig is the simulated rig, and what its controller sees of it: the equations of plant_sim::Plant,
// plant_sim::Encoder and SimDriver.
//
//   wheels    J1 omega1' = r1 F - d1 omega1 - M10 - Tb,  J2 omega2' = -r2 F - d2 omega2 - M20        (1), (2)
//   brake     Tb' = c31 (b(u) - Tb),  b of (7); ideal: Tb = the torque that is sent                  (6)
//   standing  omega1' = 0 while |r1 F| <= M10 + Tb
//   counts    floor((angle + offset) / (2 pi / counts per revolution))
//   board     duty that is sent = floor(duty * steps + 1/2) / steps
//
// Speeds in rad/s, angles in rad, torques in N m, F in N by the tyre and load models. plant_sim/runge_kutta.hpp solves
// them over a cycle. Where a wheel stops or starts, or the road or a drift changes, the scalar plant computes the cycle
// ("assist").
//
// Only the undisturbed course of a run is computed here. Where a check of the gate would look closer, or a limit ends
// the run, `disturbed` is set, and `simulate` computes the run.
//
// A run has nothing but scalars as members, so that run and lane have the same words (rig/pack.hpp).
#pragma once

#include <limits>

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

namespace abs_hil::study::lanes {

/// The values of road and drift, and until when they hold: plant_sim::PlantConditions.
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
  S ideal_brake{0.0};  ///< 1: the brake gives the torque that is sent at once
  plant_sim::BasicState<S> x{};
  S steps{0.0};  ///< of the latest cycle
  S rad_per_count{0.0};
  S upper_offset_rad{0.0};
  S lower_offset_rad{0.0};
  S duty_steps{0.0};

  /// Advances by `duration_s`, to `time_ns`, under a duty of the brake, or an ideal brake's torque. True where a wheel
  /// stops or starts, or road or drift change: the state is wrong there.
  [[gnu::noinline, gnu::flatten]] auto advance(const S& duration_s, const S& time_ns, const S& duty,
                                               const S& torque_Nm) noexcept {
    using namespace plant_sim;
    const auto ideal = ideal_brake > 0.0;
    const S static_Nm = rig::select(ideal, torque_Nm, rig::brake_torque_at(brake, duty));
    const BrakeAlone<S> held{static_Nm * now.brake_torque, rig::select(ideal, S(0.0), brake.c31_per_s)};
    x[brake_torque] = rig::select(ideal, held.brake_target_Nm, x[brake_torque]);
    const auto rolls = x[omega1] > 0.0 && x[omega2] > 0.0;
    const auto stands = x[omega1] == 0.0 && x[omega2] > 0.0;
    auto well = rolls;
    if (rig::any(rolls)) {
      const RollingBalance<S, Tyre, Load, BrakeAlone<S>> balance{tyre, load, now.wheels, held, now.friction};
      well = go_on(balance, duration_s, rolls,
                   [](const BasicState<S>& end) { return end[omega1] > 0.0 && end[omega2] > 0.0; });
    }
    if (rig::any(stands)) well = well || stand(held, duration_s, stands);
    return !well || time_ns > now.steady_to_ns || x[angle2] > now.steady_to_angle2_rad;
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
    using namespace plant_sim;
    const BrakeAlone<S> any{};
    const RollingBalance<S, Tyre, Load, BrakeAlone<S>> turning{tyre, load, now.wheels, any, now.friction};
    const S turning_N = load.force_N(now.friction, S(1.0), turning.upper_torques(x));
    if constexpr (Load::knows_sliding) {
      const auto stands = x[omega1] == 0.0;
      if (!rig::any(stands)) return turning_N;
      const HeldBalance held{tyre, load, now.wheels, any, now.friction};
      const S held_N = load.force_N(now.friction, S(1.0), held.upper_torques(x));
      return rig::select(stands && held.holds_upper(x), held_N, turning_N);
    } else {
      return turning_N;
    }
  }

 private:
  using HeldBalance = plant_sim::RollingBalance<S, Tyre, Load, plant_sim::BrakeAlone<S>, plant_sim::Held>;

  /// Makes all steps of a cycle in these lanes. True where `well(end)` at the end of each.
  template <class Balance, class Condition, class Well>
  [[gnu::always_inline]] Condition go_on(const Balance& balance, const S& duration_s, const Condition& where,
                                         const Well& well) noexcept {
    using namespace plant_sim;
    const S needed = steps_for(duration_s, max_step_s, balance.fastest_rate_per_s(x));
    steps = rig::select(where, needed, steps);
    return where && steps_made(balance, needed, S(duration_s / needed), where, x, well) == needed;
  }
  /// A cycle in which the brake holds the upper wheel. True where it does so throughout.
  template <class Condition>
  [[gnu::noinline, gnu::flatten]] Condition stand(const plant_sim::BrakeAlone<S>& held, const S& duration_s,
                                                  const Condition& stands) noexcept {
    const HeldBalance balance{tyre, load, now.wheels, held, now.friction};
    return go_on(balance, duration_s, stands && balance.holds_upper(x), [&](const plant_sim::BasicState<S>& end) {
      return balance.holds_upper(end) && end[plant_sim::omega2] > 0.0;
    });
  }
};

/// A wheel as the controller sees it: its counter, and the speed and acceleration that the tracker makes of it.
template <class S>
struct LaneWheel {
  control::SpeedTracker<S> tracker{};
  S counts{0.0};
  S travel{0.0};  ///< counts over the past cycle
  S omega_rad_s{0.0};
  S alpha_rad_s2{0.0};
  S travel_rad{0.0};

  void begin(const S& counts_now, const S& start_speed_rad_s) noexcept {
    counts = counts_now;
    tracker.reset(start_speed_rad_s);
    omega_rad_s = start_speed_rad_s;
  }
  /// Takes a reading, and the true speed where sensors are ideal.
  template <class Condition>
  void take(const S& counts_now, const Condition& ideal, const S& true_rad_s, const S& dt_s) noexcept {
    travel = counts_now - counts;
    counts = counts_now;
    tracker.take(travel);
    const S before_rad_s = omega_rad_s;
    omega_rad_s = rig::select(ideal, true_rad_s, tracker.omega_rad_s());
    alpha_rad_s2 = rig::select(ideal, S((true_rad_s - before_rad_s) / dt_s), tracker.alpha_rad_s2());
    travel_rad = rig::select(ideal, S(0.5 * (before_rad_s + true_rad_s) * dt_s), S(travel * tracker.rad_per_count()));
  }
  template <class Condition>
  [[nodiscard]] Condition stands_still(const Condition& ideal) const noexcept {
    return (ideal && omega_rad_s == 0.0) || (!ideal && tracker.stands_still());
  }
  /// The counter moved further than any wheel can, or nears its end.
  [[nodiscard]] auto leaps(const S& sure_counts) const noexcept {
    constexpr double near_wrap = 2e9;
    return rig::magnitude(travel) > sure_counts || rig::magnitude(counts) > near_wrap;
  }
};

/// The part of the command gate that acts in an undisturbed run: its limits on the duty, and its checks of the wheels,
/// which must all be quiet.
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
    const auto too_fast = [&](const S& omega_rad_s) {
      return rig::magnitude(omega_rad_s) - slack(omega_rad_s) > overspeed_rad_s;
    };
    const auto ends = momentum.take(window, watch.brake_Nm());
    const auto quiet_wheels = upper_in_reach && lower_in_reach && !too_fast(window.omega1_rad_s) &&
                              !too_fast(window.omega2_rad_s) &&
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

/// All of a run but its law. It is a class of its own so that the compiler meets it once a rig and not once a law.
template <class S, template <class> class Tyre, template <class> class Load>
struct BrakingCourse {
  using Scalar = S;
  using Condition = decltype(S(0.0) < S(0.0));

  LaneRig<S, Tyre<S>, Load<S>> rig{};
  LaneGate<S> gate{};
  LaneSequence<S> sequence{};
  LaneWheel<S> upper{};
  LaneWheel<S> lower{};
  S ideal_sensors{0.0};   ///< 1: the controller reads the true speeds
  S disc_error_rad{0.0};  ///< that the readings may have
  control::BasicBrakeActuator<S> actuator{};
  analysis::BrakingFigures<S> figures{};
  rig::BrakingDistance<S> distance{};
  S r1_m{0.0};  ///< of the model
  S r2_m{0.0};
  S slip_ref{0.0};
  S period_s{0.0};
  S period_ns{0.0};
  S time_ns{0.0};
  S duty{0.0};  ///< sent to the board
  S sent_Nm{0.0};
  S unsent_Nm{0.0};
  S complete{0.0};   ///< 1: the figures are complete
  S disturbed{0.0};  ///< 1: `simulate` has to compute the run

  /// Every cycle but the first.
  /// @param window_ends  the gate's speed window ends with it
  /// @param assist  called as assist(where, before) if a wheel stops or starts, or road or drift change: it has to set
  ///   the plant's state and conditions there, from the state before the cycle
  /// @param answer  the law's, called as answer(input)
  template <class Assist, class Answer>
  void cycle(bool window_ends, const Assist& assist, const Answer& answer, bool estimates_theta) noexcept {
    time_ns += period_ns;
    const plant_sim::BasicState<S> before = rig.x;
    if (const Condition wrong = rig.advance(period_s, time_ns, duty, sent_Nm); rig::any(wrong)) assist(wrong, before);
    observe(window_ends);
    send(answer(situation(period_s)), estimates_theta, period_s);
  }

 protected:
  void disturb(const Condition& where) noexcept { disturbed = rig::select(where, S(1.0), disturbed); }

  /// Reads the encoders, and asks the gate whether all is quiet.
  [[gnu::noinline, gnu::flatten]] void observe(bool window_ends) noexcept {
    // With a lever the peak force depends on the direction in which the wheel turns.
    if constexpr (Load<S>::knows_sliding) disturb(!(rig.x[plant_sim::omega1] >= 0.0));
    const Condition ideal = ideal_sensors > 0.0;
    upper.take(rig.upper_counts(), ideal, rig.x[plant_sim::omega1], period_s);
    lower.take(rig.lower_counts(), ideal, rig.x[plant_sim::omega2], period_s);
    gate.brake_impulse_Nms +=
        rig::select(rig.ideal_brake > 0.0, sent_Nm, rig::brake_torque_at(gate.brake, duty)) * period_s;
    disturb(upper.leaps(gate.sure_counts) || lower.leaps(gate.sure_counts));
    if (window_ends) disturb(!gate.quiet(upper.counts, lower.counts));
    actuator.advance(period_s);
  }
  /// The phase, and what the law is told.
  [[gnu::noinline, gnu::flatten]] control::BasicSlipInput<S> situation(const S& dt_s) noexcept {
    const S time_s = time_ns * rig::s_per_ns;
    const Condition ideal = ideal_sensors > 0.0;
    const S slip =
        rig::wheel_slip(S(r1_m * upper.omega_rad_s), S(r2_m * lower.omega_rad_s), S(experiment::slip_floor_m_s));
    disturb(
        sequence.update(time_s, S(r2_m * lower.omega_rad_s), upper.stands_still(ideal) && lower.stands_still(ideal)));
    return {.dt_s = dt_s,
            .speeds = {upper.omega_rad_s, lower.omega_rad_s},
            .slip = slip,
            .slip_ref = slip_ref,
            .mean_brake_torque_Nm = actuator.mean_torque_Nm(),
            .brake_torque_Nm = actuator.torque_Nm(),
            .max_brake_torque_Nm = actuator.max_torque_Nm(),
            .alpha1_rad_s2 = upper.alpha_rad_s2,
            .alpha2_rad_s2 = lower.alpha_rad_s2,
            .upper_travel_rad = upper.travel_rad,
            .lower_travel_rad = lower.travel_rad,
            .disc_error_rad = disc_error_rad,
            .sent_brake_torque_Nm = sent_Nm,
            .unsent_torque_Nm = unsent_Nm};
  }
  /// Gate and board, from the law's answer to the duty, and the figures of the cycle.
  [[gnu::noinline, gnu::flatten]] void send(const control::BasicSlipOutput<S>& output, bool estimates_theta,
                                            const S& dt_s) noexcept {
    // A controller's output must be finite, and what the gate sees too. Numbers that large are no part of a sound run.
    constexpr double sound = 1e30;
    const S theta_N = estimates_theta ? output.theta_est_N : S(0.0);
    disturb(!(rig::magnitude(output.brake_torque_Nm) < sound &&
              rig::magnitude(output.slip_velocity_error_m_s) < sound && rig::magnitude(theta_N) < sound &&
              rig::magnitude(upper.omega_rad_s) <= gate.overspeed_rad_s &&
              rig::magnitude(lower.omega_rad_s) <= gate.overspeed_rad_s));
    const Condition braking = sequence.holds == 0.0;
    const S wanted_Nm = rig::select(braking, output.brake_torque_Nm, sequence.hold_torque_Nm);
    const auto target = actuator.next(wanted_Nm, dt_s);
    analysis::BrakingSample<S> sample{.time_s = time_ns * rig::s_per_ns,
                                      .v_x_m_s = rig.v_x_m_s(),
                                      .slip = rig.slip(),
                                      .slip_ref = rig::select(rig::is_nan(output.slip_ref), slip_ref, output.slip_ref),
                                      .theta_est_N = output.theta_est_N,
                                      .theta_N = rig.peak_force_N()};
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
};

template <class S, template <class> class Law, template <class> class Tyre, template <class> class Load>
struct BrakingRun : BrakingCourse<S, Tyre, Load> {
  using Course = BrakingCourse<S, Tyre, Load>;

  Law<S> law{};

  /// The first cycle: both wheels turn at this speed, and the controller begins.
  void begin(const S& start_speed_rad_s) noexcept {
    this->rig.x[plant_sim::omega1] = this->rig.x[plant_sim::omega2] = start_speed_rad_s;
    this->upper.begin(this->gate.begin_upper = this->rig.upper_counts(), start_speed_rad_s);
    this->lower.begin(this->gate.begin_lower = this->rig.lower_counts(), start_speed_rad_s);
    this->actuator.reset();
    const control::BasicSlipInput<S> input = this->situation(S(0.0));
    law.reset(input);
    this->send(law.step(input), Law<S>::estimates_theta, S(0.0));
  }
};

}  // namespace abs_hil::study::lanes
