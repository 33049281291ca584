// Steps through the phases of an experiment and tells what each asks of motor and brake.
#include "experiment/sequence.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace abs_hil::experiment {

namespace {
/// Encoder noise below this must not count as a new maximum of the wheel's speed.
constexpr double peak_margin_rad_s = 0.2;
/// Upper limit of every phase's time limit.
constexpr double longest_phase_s = 600.0;

/// Checks limits that hold for every phase, whatever its source. Throws std::invalid_argument.
void check_safe(const PhasePlan& plan, const std::string& name) {
  const auto refuse = [&name](const std::string& what) { throw std::invalid_argument("phase " + name + what); };
  if (!(plan.time_limit_s > 0.0 && plan.time_limit_s <= longest_phase_s)) {
    refuse(": time limit " + std::to_string(plan.time_limit_s) + " s: give a limit in (0, 600] s");
  }
  const auto require = [&refuse](const Profile& profile, double most, const std::string& what,
                                 const std::string& give) {
    for (const Profile::Point& point : profile.points()) {
      if (!(point.value >= 0.0 && point.value <= most)) {
        refuse(": " + what + ' ' + std::to_string(point.value) + ": give " + give);
      }
    }
  };
  require(plan.motor_duty, 1.0, "motor duty", "a duty in [0, 1]");
  require(plan.brake_torque_Nm, std::numeric_limits<double>::max(), "brake torque", "a finite torque >= 0 N m");
  require(plan.brake_duty, 1.0, "brake duty", "a duty in [0, 1]");
  require(plan.slip_ref, 1.0, "slip reference", "a reference in (0, 1)");
  if (plan.wheels_apart && plan.brake == BrakeAction::slip_control)
    refuse(": wheels that are apart have no slip to control; give the brake a duty or a torque");
  const bool brakes = plan.brake == BrakeAction::slip_control ||
                      (plan.brake == BrakeAction::torque && !plan.brake_torque_Nm.zero()) ||
                      (plan.brake == BrakeAction::duty && !plan.brake_duty.zero());
  const bool drives = !plan.motor_duty.zero();
  // Somebody may have a hand at the wheels.
  if (!plan.question.empty() && (drives || plan.brake != BrakeAction::released)) {
    refuse(": it asks a person, so that motor and brake must be off; give them phases of their own");
  }
  if (drives && brakes && !plan.motor_with_brake) {
    refuse(": motor and brake act together: leave one of them out, or set motor_with_brake = true");
  }
}

PhasePlan braking(rig::Phase phase, const StopBrake& brake) {
  return {.phase = phase,
          .brake = brake.duty > 0.0 ? BrakeAction::duty : BrakeAction::released,
          .brake_duty = brake.duty,
          .time_limit_s = brake.limit_s};
}

/// True if one wrong sample of speed or slip could make the condition hold.
bool on_estimates(const EndCondition& condition) noexcept {
  return row_of(condition.kind).on_estimates ||
         std::any_of(condition.parts.begin(), condition.parts.end(), on_estimates);
}
}  // namespace

Sequence::Sequence(std::vector<PhasePlan> plans, const SequenceLimits& limits, const StopBrake& stop_brake,
                   const StopBrake& fault_brake)
    : plans_(std::move(plans)),
      limits_(limits),
      stop_plan_(braking(rig::Phase::hold, stop_brake)),
      fault_plan_(braking(rig::Phase::fault, fault_brake)) {
  check_safe(stop_plan_, "after a stop request");
  check_safe(fault_plan_, "after a fault");
  if (plans_.empty()) throw std::invalid_argument("a sequence has no phases; give at least one");
  for (const PhasePlan& plan : plans_) {
    const std::string name(rig::name_of(plan.phase));
    if (plan.ends_on.empty()) throw std::invalid_argument("phase " + name + " has no end condition; give at least one");
    check_safe(plan, name);
    held_.resize(std::max(held_.size(), plan.ends_on.size()));
  }
}

runtime::PhasePermissions Sequence::permissions() const noexcept {
  runtime::PhasePermissions permissions{};
  for (const PhasePlan& plan : plans_) {
    runtime::PhasePermission& may = permissions[static_cast<std::size_t>(plan.phase)];
    may.motor = may.motor || !plan.motor_duty.zero();
    may.brake = may.brake || plan.brake != BrakeAction::released;
    may.together = may.together || plan.motor_with_brake;
  }
  if (fault_plan_.brake == BrakeAction::duty) permissions[static_cast<std::size_t>(fault_plan_.phase)].brake = true;
  if (stop_plan_.brake == BrakeAction::duty) permissions[static_cast<std::size_t>(stop_plan_.phase)].brake = true;
  return permissions;
}

void Sequence::enter(std::size_t index, const SequenceInput& input) noexcept {
  index_ = index;
  started_ = true;
  wheels_apart_ = plans_[index].wheels_apart;
  entered_at_s_ = input.time_s;
  entered_at_m_ = input.distance_m;
  peak_speed_rad_s_ = input.speeds.omega1_rad_s;
  peak_at_s_ = input.time_s;
  std::fill(held_.begin(), held_.end(), std::uint8_t{0});
}

inline bool Sequence::holds(const EndCondition& condition, const SequenceInput& input) const noexcept {
  const double value = condition.value;
  switch (condition.kind) {
#define ABS_HIL_HOLDS(kind, key, unit, range, meaning, in_words, reason, precision, ...) \
  case EndKind::kind: return __VA_ARGS__;
    ABS_HIL_END_CONDITIONS(ABS_HIL_HOLDS)
#undef ABS_HIL_HOLDS
  }
  return false;
}

bool Sequence::all_hold(const std::vector<EndCondition>& parts, const SequenceInput& input) const noexcept {
  for (const EndCondition& part : parts) {
    if (!holds(part, input)) return false;
  }
  return !parts.empty();
}

const EndCondition* Sequence::ending(const SequenceInput& input) noexcept {
  if (input.speeds.omega1_rad_s > peak_speed_rad_s_ + peak_margin_rad_s) {
    peak_speed_rad_s_ = input.speeds.omega1_rad_s;
    peak_at_s_ = input.time_s;
  }
  const std::vector<EndCondition>& conditions = plans_[index_].ends_on;
  const bool fresh = input.time_s > now_s_;
  for (std::size_t i = 0; i < conditions.size(); ++i) {
    const bool held = held_[i] != 0;
    const bool now = holds(conditions[i], input);
    if (fresh) held_[i] = now ? 1 : 0;
    if (now && ((fresh && held) || !on_estimates(conditions[i]))) return &conditions[i];
  }
  return nullptr;
}

Sequence::Change Sequence::end(rig::Phase phase, rig::Reason reason, double value) noexcept {
  ended_ = true;
  last_.phase = phase;
  return {true, reason, value};
}

Sequence::Change Sequence::stop(const SequenceInput& input, const runtime::RunLatch& latch) noexcept {
  const bool brakes = stop_plan_.brake == BrakeAction::duty && started_ && !input.stands_still;
  const bool in_time = !stopping_ || input.time_s - entered_at_s_ < stop_plan_.time_limit_s;
  if (!brakes || !in_time) return end(rig::Phase::stopped, latch.stop_request(), 0.0);
  if (stopping_) return {};
  enter(index_, input);
  stopping_ = true;
  return {true, latch.stop_request(), 0.0};
}

Sequence::Change Sequence::fail(const SequenceInput& input, const runtime::RunLatch& latch) noexcept {
  const bool barred = latch.brake_barred_by() != rig::Reason::none;
  const bool brakes = fault_plan_.brake == BrakeAction::duty && !barred && started_ && !input.stands_still;
  const bool in_time = !failing_ || input.time_s - entered_at_s_ < fault_plan_.time_limit_s;
  if (!brakes || !in_time) return end(rig::Phase::fault, latch.fault(), latch.fault_value());
  if (failing_) return {};
  enter(index_, input);
  failing_ = true;
  return {true, latch.fault(), latch.fault_value()};
}

Sequence::Change Sequence::update(const SequenceInput& input, runtime::RunLatch& latch) noexcept {
  if (ended_) return {};
  const Change change = advance(input, latch);
  now_s_ = input.time_s;
  return change;
}

Sequence::Change Sequence::advance(const SequenceInput& input, runtime::RunLatch& latch) noexcept {
  if (latch.fault() != rig::Reason::none) return fail(input, latch);
  if (latch.stop_request() != rig::Reason::none) return stop(input, latch);
  if (!started_) {
    enter(0, input);
    return {true, rig::Reason::run_started, input.speeds.omega2_rad_s};
  }
  if (const EndCondition* condition = ending(input)) {
    if (index_ + 1 < plans_.size()) {
      enter(index_ + 1, input);
      return {true, condition->reason, condition->value};
    }
    if (input.wheels_sound) return end(rig::Phase::stopped, rig::Reason::sequence_complete, input.time_s);
  }
  const double lasted_s = input.time_s - entered_at_s_;
  if (input.time_s > limits_.run_time_s) {
    latch.latch(rig::Reason::run_time_limit, input.time_s);
  } else if (input.distance_m > limits_.distance_m) {
    latch.latch(rig::Reason::run_distance_limit, input.distance_m);
  } else if (lasted_s > plans_[index_].time_limit_s) {
    const bool asks = !plans_[index_].question.empty();
    latch.latch(asks ? rig::Reason::question_unanswered : rig::Reason::phase_time_limit, lasted_s);
  } else {
    return {};
  }
  return fail(input, latch);
}

}  // namespace abs_hil::experiment
