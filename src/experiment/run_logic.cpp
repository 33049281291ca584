// One cycle of an experiment: estimates, phase, controller, feed-forward, in this order.
#include "experiment/run_logic.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "abs_hil/control/registry.hpp"
#include "abs_hil/rig/brake_map.hpp"
#include "abs_hil/rig/time_units.hpp"
#include "abs_hil/rig/tyre_curve.hpp"
#include "rig/encoder_scale.hpp"

namespace abs_hil::experiment {

namespace {
constexpr double bump_fades_s = 0.05;  ///< about the brake's time constant
constexpr double bump_gone_Nm = 1e-6;
/// Longest wait for the start command, s.
constexpr double start_limit_s = 600.0;

/// The slip that a change of the motor or the start leaves fades within this time; no cubic follows that.
constexpr double slip_settles_s = 0.05;

struct FastestChange {
  double upper{0.0};
  double lower{0.0};
};

/// By the gate's bounds of what the rig can do.
FastestChange fastest_change_rad_s2(const RunLogicParts& parts) {
  const runtime::PlausibilityLimits limits = runtime::plausibility_limits(parts.identity, parts.ideal_actuator, {});
  return {std::max(limits.upper_gain_rad_s2, limits.upper_loss_rad_s2),
          std::max(limits.lower_gain_rad_s2, limits.lower_loss_rad_s2)};
}
}  // namespace

RunLogicParts make_logic_parts(const control::ControlOptions& control, const rig::RigParameters& rig,
                               const rig::RigParameters& identity, bool ideal_actuator,
                               const runtime::GateOptions& gate, const ExperimentOptions& experiment,
                               std::vector<PhasePlan> plans, const SequenceLimits& limits) {
  if (experiment.wait_for_start) {
    plans.insert(plans.begin(), {.phase = rig::Phase::idle,
                                 .name = "waiting for the start",
                                 .ends_on = {{EndKind::start_command, 0.0, rig::Reason::start_command}},
                                 .time_limit_s = start_limit_s});
  }
  auto controller = control::make_controller(control.controller, {control, rig});
  rig::RunNames names{.signals = rig::signal_names(controller->signals())};
  for (const PhasePlan& plan : plans) names.phases.push_back({plan.phase, plan.name, plan.question});
  return {.control = control,
          .rig = rig,
          .identity = identity,
          .controller = std::move(controller),
          .names = std::move(names),
          .sequence = Sequence(
              std::move(plans), limits, {.duty = experiment.stop_brake_duty, .limit_s = experiment.stop_brake_limit_s},
              {.duty = std::min(gate.fault_brake_duty, gate.brake_duty_max), .limit_s = gate.fault_brake_limit_s}),
          .ideal_actuator = ideal_actuator,
          .max_brake_duty = gate.brake_duty_max,
          .start_speed_rad_s = experiment.start_speed_rad_s,
          .answers_itself = experiment.answers != answers_person};
}

double unlearnt_disc_rad(const control::ObserverOptions& options, const rig::RigParameters& model) noexcept {
  const bool known = model.upper_encoder.eccentricity_rad > 0.0 || model.lower_encoder.eccentricity_rad > 0.0;
  return known || !(options.learn_eccentricity_s > 0.0) ? 0.0 : options.unlearnt_eccentricity_rad;
}

RunLogic::RunLogic(RunLogicParts parts)
    : identity_(parts.identity),
      ideal_actuator_(parts.ideal_actuator),
      duty_steps_(parts.duty_steps),
      wheels_(parts.rig.wheels),
      slip_ref_(parts.control.slip_ref),
      brake_(parts.rig.brake),
      start_speed_rad_s_(parts.start_speed_rad_s),
      controller_(std::move(parts.controller)),
      sequence_(std::move(parts.sequence)),
      upper_(parts.control.observer, parts.rig.encoder_counts_per_rev, fastest_change_rad_s2(parts).upper,
             parts.rig.upper_encoder),
      lower_(parts.control.observer, parts.rig.encoder_counts_per_rev, fastest_change_rad_s2(parts).lower,
             parts.rig.lower_encoder),
      learns_eccentricity_(parts.control.observer.learn_eccentricity_s > 0.0),
      upper_fit_(parts.control.observer.learn_eccentricity_s, parts.rig.encoder_counts_per_rev),
      lower_fit_(parts.control.observer.learn_eccentricity_s, parts.rig.encoder_counts_per_rev),
      disc_error_rad_(unlearnt_disc_rad(parts.control.observer, parts.rig)),
      actuator_(parts.rig.brake, parts.ideal_actuator, parts.max_brake_duty, parts.duty_steps),
      own_signal_count_(std::min(controller_->signals().size(), rig::signal_max)),
      answers_itself_(parts.answers_itself) {}

void RunLogic::exchange_state(rig::StateBytes& state) {
  if (!controller_->exchange_state(state)) throw std::invalid_argument("this controller cannot give its state");
  sequence_.exchange_state(state);
  actuator_.exchange_state(state);
  state(upper_, lower_, upper_fit_, lower_fit_, learnt_, disc_error_rad_);
  state(slip_ref_, speeds_, upper_travel_rad_, lower_travel_rad_, distance_m_, slip_, alpha1_rad_s2_, alpha2_rad_s2_);
  state(asked_Nm_, target_Nm_, sent_Nm_, unsent_Nm_, in_slip_control_, not_given_, refused_output_, bump_Nm_);
  state(start_given_, answered_, end_, stands_still_, wheels_sound_, started_, start_ns_, last_ns_);
}

runtime::SendableDuties RunLogic::sendable(const runtime::GateOptions& options) const noexcept {
  return {.motor = rig::duty_at_most(options.motor_duty_max, duty_steps_),
          .brake = rig::duty_at_most(options.brake_duty_max, ideal_actuator_ ? 0 : duty_steps_)};
}

void RunLogic::estimate(const rig::Measurement& measurement, double dt_s, double stamp_error_s) noexcept {
  if (!started_) {
    upper_.reset(measurement.upper_counts, start_speed_rad_s_);
    lower_.reset(measurement.lower_counts, start_speed_rad_s_);
    actuator_.reset();
  } else if (dt_s > 0.0) {
    upper_.update(measurement.upper_counts, dt_s, stamp_error_s, measurement.upper_edge_age_ns * rig::s_per_ns);
    lower_.update(measurement.lower_counts, dt_s, stamp_error_s, measurement.lower_edge_age_ns * rig::s_per_ns);
    actuator_.advance(dt_s);
  }
  note_travel(measurement, dt_s);
  if (measurement.ideal_speeds) {
    disc_error_rad_ = 0.0;
    // The mean over the past cycle from true speeds, without the errors of encoders and observer.
    if (started_ && dt_s > 0.0) {
      alpha1_rad_s2_ = (measurement.ideal_speeds->omega1_rad_s - speeds_.omega1_rad_s) / dt_s;
      alpha2_rad_s2_ = (measurement.ideal_speeds->omega2_rad_s - speeds_.omega2_rad_s) / dt_s;
    }
    speeds_ = *measurement.ideal_speeds;
    stands_still_ = speeds_.omega1_rad_s == 0.0 && speeds_.omega2_rad_s == 0.0;
  } else {
    speeds_ = {upper_.omega_rad_s(), lower_.omega_rad_s()};
    alpha1_rad_s2_ = upper_.alpha_rad_s2();
    alpha2_rad_s2_ = lower_.alpha_rad_s2();
    stands_still_ = upper_.stands_still() && lower_.stands_still();
  }
  slip_ = rig::wheel_slip(wheels_.r1_m * speeds_.omega1_rad_s, wheels_.r2_m * speeds_.omega2_rad_s, slip_floor_m_s);
}

void RunLogic::note_travel(const rig::Measurement& measurement, double dt_s) noexcept {
  if (measurement.ideal_speeds) {
    const rig::WheelSpeeds& now = *measurement.ideal_speeds;
    upper_travel_rad_ = 0.5 * (speeds_.omega1_rad_s + now.omega1_rad_s) * dt_s;
    lower_travel_rad_ = 0.5 * (speeds_.omega2_rad_s + now.omega2_rad_s) * dt_s;
  } else {
    const bool moved = started_ && dt_s > 0.0;  // otherwise the next reading has the travel
    upper_travel_rad_ = moved ? upper_.travel_rad() : 0.0;
    lower_travel_rad_ = moved ? lower_.travel_rad() : 0.0;
  }
  distance_m_ += wheels_.r2_m * lower_travel_rad_;
}

/// While the wheels turn without brake, each reading goes into the fit of its disc. What a block of them gives holds
/// from then on.
void RunLogic::learn_eccentricity(const rig::Measurement& measurement, const PhasePlan& plan) noexcept {
  const bool turns_freely = plan.brake == BrakeAction::released && sequence_.phase_time_s() >= slip_settles_s;
  if (!turns_freely || !wheels_sound_) {
    upper_fit_.restart();
    lower_fit_.restart();
    return;
  }
  const auto learn = [&measurement](auto& fit, std::int32_t counts, auto& observer, double& learnt_rad) {
    const auto found = fit.take(measurement.time_ns, counts);
    if (!found) return;
    observer.know(*found);
    learnt_rad = found->eccentricity_rad;
  };
  learn(upper_fit_, measurement.upper_counts, upper_, learnt_.upper_rad);
  learn(lower_fit_, measurement.lower_counts, lower_, learnt_.lower_rad);
  if (!std::isnan(learnt_.upper_rad) && !std::isnan(learnt_.lower_rad)) disc_error_rad_ = 0.0;
}

double RunLogic::slip_control(double dt_s, bool begins, rig::ControlState& state) noexcept {
  control::SlipInput input{.dt_s = begins ? 0.0 : dt_s,
                           .speeds = speeds_,
                           .slip = slip_,
                           .slip_ref = state.slip_ref,
                           .mean_brake_torque_Nm = actuator_.mean_torque_Nm(),
                           .brake_torque_Nm = actuator_.torque_Nm(),
                           .max_brake_torque_Nm = actuator_.max_torque_Nm(),
                           .alpha1_rad_s2 = alpha1_rad_s2_,
                           .alpha2_rad_s2 = alpha2_rad_s2_,
                           .upper_travel_rad = upper_travel_rad_,
                           .lower_travel_rad = lower_travel_rad_,
                           .disc_error_rad = disc_error_rad_,
                           .sent_brake_torque_Nm = begins ? 0.0 : sent_Nm_,
                           .unsent_torque_Nm = begins ? 0.0 : unsent_Nm_,
                           .ahead = actuator_.ahead()};
  if (begins) controller_->reset(input);
  const control::SlipOutput output = controller_->step(input);
  if (refused(output, begins)) return 0.0;
  if (begins) bump_Nm_ = 0.0;
  state.slip_velocity_error_m_s = output.slip_velocity_error_m_s;
  state.theta_est_N = output.theta_est_N;
  state.signals = output.signals;
  if (!std::isnan(output.slip_ref)) state.slip_ref = output.slip_ref;
  asked_Nm_ = without_bump(output.brake_torque_Nm, input);
  return asked_Nm_;
}

/// True for an output that is no number, unless the controller does not give it. Ends the run then.
inline bool RunLogic::breaks(std::size_t n, double value, bool begins) noexcept {
  if (begins) not_given_[n] = n != 0 && std::isnan(value);
  if (std::isfinite(value) || (not_given_[n] && std::isnan(value))) return false;
  refused_output_ = static_cast<int>(n);
  return true;
}

/// Checks a controller's whole output before anything uses it. The torque must be finite. The others, its own signals
/// too, may be NaN if they were NaN when the controller began: it does not give them.
bool RunLogic::refused(const control::SlipOutput& output, bool begins) noexcept {
  const std::array<double, rig::controller_signals.size()> outputs{
      output.brake_torque_Nm, output.slip_velocity_error_m_s, output.theta_est_N, output.slip_ref};
  for (std::size_t n = 0; n < outputs.size(); ++n) {
    if (breaks(n, outputs[n], begins)) return true;
  }
  double sum = 0.0;  // finite only if all are, and all but certainly if they are
  for (std::size_t n = 0; n < own_signal_count_; ++n) sum += output.signals[n];
  if (std::isfinite(sum) && !begins) return false;
  for (std::size_t n = 0; n < own_signal_count_; ++n) {
    if (breaks(outputs.size() + n, output.signals[n], begins)) return true;
  }
  return false;
}

/// Makes a change of gains bumpless. New gains take effect on changes of the torque at once, but the jump that they
/// would cause fades out within about 50 ms. Integral and estimates continue.
double RunLogic::without_bump(double torque_Nm, const control::SlipInput& input) noexcept {
  if (replaced_ != nullptr) {
    bump_Nm_ += replaced_->step(input).brake_torque_Nm - torque_Nm;
    if (!std::isfinite(bump_Nm_)) bump_Nm_ = 0.0;
  } else if (bump_Nm_ != 0.0) {
    bump_Nm_ *= std::exp(-input.dt_s / bump_fades_s);
    if (std::abs(bump_Nm_) < bump_gone_Nm) bump_Nm_ = 0.0;
  }
  return torque_Nm + bump_Nm_;
}

void RunLogic::adjust(rig::CycleRecord& record) noexcept {
  AdjustmentMailbox::Arrived arrived{};
  if (!adjustments_.take(arrived)) return;
  switch (arrived.kind) {
    case Adjustment::Kind::start: start_given_ = true; return;  // the record of the next phase shows it
    case Adjustment::Kind::answer: answered_ = true; return;
    case Adjustment::Kind::slip_ref:
      slip_ref_ = arrived.slip_ref;
      record.reason = rig::Reason::slip_reference_changed;
      break;
    case Adjustment::Kind::controller:
      static_cast<void>(arrived.controller->take_over(*controller_));
      replaced_ = controller_.release();
      controller_.reset(arrived.controller);
      record.reason = rig::Reason::gain_changed;
      break;
  }
  record.reason_value = arrived.number;
}

rig::Command RunLogic::step(const rig::Measurement& measurement, runtime::RunLatch& latch,
                            rig::CycleRecord& record) noexcept {
  if (!started_) start_ns_ = last_ns_ = measurement.time_ns;
  const double dt_s = static_cast<double>(measurement.time_ns - last_ns_) * rig::s_per_ns;
  last_ns_ = measurement.time_ns;
  const std::int64_t stamp_error_ns = rig::stamp_error_ns(measurement.time_ns, record.stamp_ns, record.timing.read_ns);
  estimate(measurement, dt_s, static_cast<double>(stamp_error_ns) * rig::s_per_ns);
  started_ = true;

  const Sequence::Change change =
      sequence_.update({.time_s = static_cast<double>(measurement.time_ns - start_ns_) * rig::s_per_ns,
                        .speeds = speeds_,
                        .car_speed_m_s = wheels_.r2_m * speeds_.omega2_rad_s,
                        .stands_still = stands_still_,
                        .start_given = start_given_,
                        .answered = answered_,
                        .wheels_sound = wheels_sound_,
                        .slip = slip_,
                        .distance_m = distance_m_},
                       latch);
  if (change.entered && sequence_.finished()) end_ = change;
  const PhasePlan& plan = sequence_.current();
  if (learns_eccentricity_ && dt_s > 0.0) learn_eccentricity(measurement, plan);
  record.phase = plan.phase;
  record.phase_index = static_cast<std::uint16_t>(sequence_.index());
  record.reason = change.reason;
  record.reason_value = change.value;
  record.wheels_apart = sequence_.wheels_apart();
  if (change.entered) {
    answered_ = answers_itself_;  // an answer counts for the phase that asked
  } else {
    adjust(record);
  }

  rig::ControlState& state = record.control;
  state.speeds_est = speeds_;
  state.slip_est = slip_;
  state.slip_ref = slip_ref_;
  state.brake_torque_est_Nm = actuator_.torque_Nm();

  // Over consecutive phases that use it, the controller goes on with its estimates.
  const bool begins = change.entered && (!in_slip_control_ || plan.restart);
  in_slip_control_ = plan.brake == BrakeAction::slip_control;
  const double phase_time_s = sequence_.phase_time_s();
  asked_Nm_ = rig::unknown;
  double torque_Nm = 0.0;
  double brake_duty = 0.0;
  if (plan.brake == BrakeAction::duty) {
    brake_duty = plan.brake_duty.at(phase_time_s);
    torque_Nm = rig::brake_torque_at(brake_, brake_duty);
  } else {
    const control::BrakeActuator::Target target = actuator_.next(wanted_torque_Nm(plan, dt_s, begins, state), dt_s);
    torque_Nm = target.torque_Nm;
    brake_duty = target.duty;
  }
  if (replaced_ != nullptr) adjustments_.retire(std::exchange(replaced_, nullptr));
  if (refused_output_ >= 0) {
    latch.latch(rig::Reason::controller_not_finite, refused_output_);
    return rig::safe_command;
  }
  state.brake_torque_ref_Nm = target_Nm_ = torque_Nm;

  const double motor_duty = plan.motor_duty.at(phase_time_s);
  return {.motor_duty = motor_duty,
          .brake_duty = brake_duty,
          .motor_enable = motor_duty > 0.0,
          .brake_torque_Nm = torque_Nm};
}

double RunLogic::wanted_torque_Nm(const PhasePlan& plan, double dt_s, bool begins, rig::ControlState& state) noexcept {
  switch (plan.brake) {
    case BrakeAction::released:
    case BrakeAction::duty: return 0.0;
    case BrakeAction::torque: return plan.brake_torque_Nm.at(sequence_.phase_time_s());
    case BrakeAction::slip_control: break;
  }
  if (!plan.slip_ref.empty()) state.slip_ref = plan.slip_ref.at(sequence_.phase_time_s());
  return slip_control(dt_s, begins, state);
}

void RunLogic::commanded(const rig::Command& acted, const rig::Command& own) noexcept {
  actuator_.command(acted.brake_duty, acted.brake_torque_Nm);
  sent_Nm_ = actuator_.static_torque_Nm(own.brake_duty, own.brake_torque_Nm);
  unsent_Nm_ = std::isnan(asked_Nm_) ? 0.0 : actuator_.unsent_Nm(asked_Nm_, target_Nm_, sent_Nm_);
}

}  // namespace abs_hil::experiment
