#include "driver/injection/injecting_driver.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

namespace abs_hil::driver {

namespace {

constexpr double longest_run_s = 1e9;  ///< a longer duration, also infinity, means no end
constexpr double not_known = std::numeric_limits<double>::quiet_NaN();

double scaled_duty(double duty, double factor) noexcept { return std::clamp(duty * factor, 0.0, 1.0); }
double scaled(double value, double factor) noexcept { return value * factor; }
double shifted(double value, double offset) noexcept { return value + offset; }
double inverted(double flag, double) noexcept { return 1.0 - flag; }
double other_flags(double flags, double) noexcept { return 7.0 - flags; }

constexpr NumberFaults stamp_faults{.garbage_most = 1e12, .whole = true, .wrong = scaled};
constexpr NumberFaults supply_faults{.garbage_most = 48.0, .wrong = scaled};
constexpr NumberFaults temperature_faults{
    .off = not_known, .garbage_least = -50.0, .garbage_most = 250.0, .wrong = shifted};
constexpr NumberFaults trip_faults{
    .garbage_most = 8.0, .whole = true, .wrong = other_flags, .intermittently_wrong = true};
constexpr NumberFaults duty_faults{.wrong = scaled_duty};
constexpr NumberFaults torque_faults{.garbage_most = 10.0, .wrong = scaled};
constexpr NumberFaults enable_faults{.garbage_most = 2.0, .whole = true, .wrong = inverted};

/// NaN equals NaN here: both mean "not known".
bool differ(double a, double b) noexcept { return a != b && !(std::isnan(a) && std::isnan(b)); }

bool differ(const rig::Measurement& a, const rig::Measurement& b) noexcept {
  return a.time_ns != b.time_ns || a.upper_counts != b.upper_counts || a.lower_counts != b.lower_counts ||
         differ(a.supply_V, b.supply_V) || differ(a.temperature_C, b.temperature_C) || a.trip_flags != b.trip_flags;
}

std::int32_t any_counts(std::mt19937_64& random) noexcept {
  return std::bit_cast<std::int32_t>(static_cast<std::uint32_t>(random() >> 32U));
}

}  // namespace

InjectingDriver::InjectingDriver(std::unique_ptr<RigDriver> inner, const std::vector<Injection>& injections,
                                 std::uint64_t seed, PassTime pass_time)
    : inner_(std::move(inner)),
      seed_(seed),
      pass_time_(std::move(pass_time)),
      stamp_(stamp_faults),
      supply_(supply_faults),
      temperature_(temperature_faults),
      trip_(trip_faults),
      motor_(duty_faults),
      brake_(duty_faults),
      brake_torque_(torque_faults),
      enable_(enable_faults) {
  for (const Injection& injection : injections) planned_.push_back({injection});
}

InjectingDriver::~InjectingDriver() { static_cast<void>(deactivate()); }

std::vector<std::string> InjectingDriver::notes() const {
  std::vector<std::string> notes = inner_->notes();
  for (const Planned& planned : planned_) notes.push_back("FAULT INJECTED: " + to_text(planned.injection));
  return notes;
}

void InjectingDriver::do_activate(std::int64_t now_ns) {
  inner_->activate(now_ns);
  random_.seed(seed_);
  now_ns_ = now_ns;
  first_effect_ns_ = -1;
  first_read_ = true;
  delivered_ = {};
  passed_ = {};
  for (NumberChannel* channel :
       {&stamp_, &supply_, &temperature_, &trip_, &motor_, &brake_, &brake_torque_, &enable_}) {
    channel->start();
  }
  answers_.clear();
  commands_.clear();
  for (Planned& planned : planned_) planned.entered_ns = planned.injection.phase ? -1 : now_ns;
}

void InjectingDriver::note_phase(rig::Phase phase) noexcept {
  for (Planned& planned : planned_) {
    if (planned.entered_ns < 0 && planned.injection.phase == phase) planned.entered_ns = now_ns_;
  }
}

void InjectingDriver::note_effect(bool differs) noexcept {
  if (differs && first_effect_ns_ < 0) first_effect_ns_ = now_ns_;
}

ActiveFault InjectingDriver::fault_of(InjectionSignal signal) const noexcept {
  // The fault that began last acts. The kind `ok` ends earlier faults.
  std::int64_t latest_ns = -1;
  ActiveFault fault{};
  for (const Planned& planned : planned_) {
    if (planned.injection.signal != signal || planned.entered_ns < 0) continue;
    const std::int64_t begins_ns = planned.entered_ns + ns_of(planned.injection.delay_s);
    const bool over = now_ns_ - begins_ns >= ns_of(std::min(planned.injection.duration_s, longest_run_s));
    if (now_ns_ < begins_ns || over || begins_ns < latest_ns) continue;
    latest_ns = begins_ns;
    fault = {planned.injection.kind, planned.injection.parameter};
  }
  return fault;
}

IoResult InjectingDriver::do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept {
  now_ns_ = now_ns;
  // Always read the backend, also under a fault: the read advances an emulator's time.
  if (const IoResult result = inner_->read(now_ns, measurement); !result.ok()) return result;
  if (std::exchange(first_read_, false)) {
    upper_.start(measurement.upper_counts);
    lower_.start(measurement.lower_counts);
    delivered_ = measurement;
  }
  const rig::Measurement sound = measurement;
  fail_encoders(measurement);
  fail_numbers(measurement);
  const IoResult result = fail_whole_answer(measurement);
  note_effect(!result.ok() || differ(sound, measurement) ||
              fault_of(InjectionSignal::read).kind == InjectionKind::slow);
  if (result.ok()) delivered_ = measurement;
  return result;
}

void InjectingDriver::fail_encoders(rig::Measurement& measurement) noexcept {
  const ActiveFault both = fault_of(InjectionSignal::encoders);
  ActiveFault upper = fault_of(InjectionSignal::encoder_upper);
  ActiveFault lower = fault_of(InjectionSignal::encoder_lower);
  const rig::Measurement before = delivered_;
  std::int32_t upper_travel = upper_.travel(measurement.upper_counts);
  std::int32_t lower_travel = lower_.travel(measurement.lower_counts);
  if (both.kind == InjectionKind::wrong) {
    std::swap(upper_travel, lower_travel);
  } else if (both.kind != InjectionKind::ok) {
    upper = lower = both;
  }
  measurement.upper_counts = upper_.pass(upper_travel, upper, now_ns_, random_);
  measurement.lower_counts = lower_.pass(lower_travel, lower, now_ns_, random_);
  if (!measurement.ideal_speeds) return;
  // The true speed holds only for a sound encoder. For a faulty one it is scaled by the counts that are delivered.
  const double dt_s = static_cast<double>(measurement.time_ns - before.time_ns) * 1e-9;
  const auto speed = [&](std::int32_t from, std::int32_t to, std::int32_t travelled, double true_rad_s) {
    const double shown = rig::counts_between(from, to);
    return travelled != 0 && dt_s > 0.0 ? true_rad_s * shown / travelled : (shown == 0.0 ? 0.0 : true_rad_s);
  };
  if (both.kind == InjectionKind::wrong) {
    std::swap(measurement.ideal_speeds->omega1_rad_s, measurement.ideal_speeds->omega2_rad_s);
    return;
  }
  if (upper.kind != InjectionKind::ok) {
    measurement.ideal_speeds->omega1_rad_s =
        speed(before.upper_counts, measurement.upper_counts, upper_travel, measurement.ideal_speeds->omega1_rad_s);
  }
  if (lower.kind != InjectionKind::ok) {
    measurement.ideal_speeds->omega2_rad_s =
        speed(before.lower_counts, measurement.lower_counts, lower_travel, measurement.ideal_speeds->omega2_rad_s);
  }
}

void InjectingDriver::fail_numbers(rig::Measurement& measurement) noexcept {
  const auto pass = [this](NumberChannel& channel, InjectionSignal signal, double value) {
    return channel.pass(value, fault_of(signal), now_ns_, random_);
  };
  // A double holds whole ns for 104 days.
  measurement.time_ns =
      static_cast<std::int64_t>(pass(stamp_, InjectionSignal::stamp, static_cast<double>(measurement.time_ns)));
  measurement.supply_V = pass(supply_, InjectionSignal::supply, measurement.supply_V);
  measurement.temperature_C = pass(temperature_, InjectionSignal::temperature, measurement.temperature_C);
  measurement.trip_flags = static_cast<std::uint32_t>(pass(trip_, InjectionSignal::trip, measurement.trip_flags));
}

IoResult InjectingDriver::fail_whole_answer(rig::Measurement& measurement) noexcept {
  const ActiveFault fault = fault_of(InjectionSignal::read);
  if (fault.kind != InjectionKind::delayed) answers_.clear();
  switch (fault.kind) {
    case InjectionKind::ok: break;
    case InjectionKind::off: return {IoError::no_answer};
    case InjectionKind::stuck: measurement = delivered_; break;
    case InjectionKind::garbage:
      measurement.upper_counts = any_counts(random_);
      measurement.lower_counts = any_counts(random_);
      measurement.time_ns = static_cast<std::int64_t>(uniform(random_) * stamp_faults.garbage_most);
      measurement.supply_V = uniform(random_) * supply_faults.garbage_most;
      measurement.trip_flags = static_cast<std::uint32_t>(random_() >> 61U);
      break;
    case InjectionKind::wrong: return {IoError::implausible_answer};
    case InjectionKind::slow:
      if (pass_time_) pass_time_(ns_of(fault.parameter));
      break;
    case InjectionKind::delayed: {
      answers_.push(now_ns_, measurement);
      rig::Measurement late = delivered_;
      while (answers_.pop(now_ns_ - ns_of(fault.parameter), late)) {
      }
      measurement = late;
      break;
    }
    case InjectionKind::intermittent:
      if (uniform(random_) < fault.parameter) return {IoError::no_answer};
      break;
  }
  return {};
}

IoResult InjectingDriver::do_write(const rig::Command& command, rig::Command& sent) noexcept {
  rig::Command passed = command;
  if (const IoResult result = fail_whole_command(passed); !result.ok()) {
    note_effect(true);
    return result;
  }
  passed.motor_duty = motor_.pass(passed.motor_duty, fault_of(InjectionSignal::motor_pwm), now_ns_, random_);
  const ActiveFault brake = fault_of(InjectionSignal::brake_pwm);
  passed.brake_duty = brake_.pass(passed.brake_duty, brake, now_ns_, random_);
  passed.brake_torque_Nm = brake_torque_.pass(passed.brake_torque_Nm, brake, now_ns_, random_);
  const ActiveFault enable = fault_of(InjectionSignal::enable);
  passed.motor_enable = enable_.pass(passed.motor_enable ? 1.0 : 0.0, enable, now_ns_, random_) > 0.5;
  const bool changed = passed.motor_duty != command.motor_duty || passed.brake_duty != command.brake_duty ||
                       passed.brake_torque_Nm != command.brake_torque_Nm || passed.motor_enable != command.motor_enable;
  note_effect(changed || fault_of(InjectionSignal::write).kind == InjectionKind::slow);
  passed_ = passed;
  const IoResult result = inner_->write(passed, sent);
  if (result.ok() && changed) sent = inner_->as_sent(command);
  return result;
}

IoResult InjectingDriver::fail_whole_command(rig::Command& command) noexcept {
  const ActiveFault fault = fault_of(InjectionSignal::write);
  if (fault.kind != InjectionKind::delayed) commands_.clear();
  switch (fault.kind) {
    case InjectionKind::ok: break;
    case InjectionKind::off: return {IoError::no_answer};
    case InjectionKind::stuck: command = passed_; break;
    case InjectionKind::garbage:
      command.motor_duty = uniform(random_);
      command.brake_duty = uniform(random_);
      command.brake_torque_Nm = uniform(random_) * torque_faults.garbage_most;
      command.motor_enable = uniform(random_) < 0.5;
      break;
    case InjectionKind::wrong:
      command.motor_duty = scaled_duty(command.motor_duty, fault.parameter);
      command.brake_duty = scaled_duty(command.brake_duty, fault.parameter);
      command.brake_torque_Nm *= fault.parameter;
      break;
    case InjectionKind::slow:
      if (pass_time_) pass_time_(ns_of(fault.parameter));
      break;
    case InjectionKind::delayed: {
      commands_.push(now_ns_, command);
      rig::Command late = passed_;
      while (commands_.pop(now_ns_ - ns_of(fault.parameter), late)) {
      }
      command = late;
      break;
    }
    case InjectionKind::intermittent:
      if (uniform(random_) < fault.parameter) return {IoError::no_answer};
      break;
  }
  return {};
}

}  // namespace abs_hil::driver
