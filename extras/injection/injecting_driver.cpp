// Applies due faults to each call of the driver behind it.
#include "injection/injecting_driver.hpp"

#include <algorithm>
#include <bit>
#include <limits>
#include <utility>

#include "run/run.hpp"

namespace abs_hil::injection {

namespace {

constexpr double longest_run_s = 1e9;  ///< a longer duration, also infinity, means no end
constexpr double not_known = std::numeric_limits<double>::quiet_NaN();

double scaled_duty(double duty, double factor) noexcept { return std::clamp(duty * factor, 0.0, 1.0); }
double scaled(double value, double factor) noexcept { return value * factor; }
double shifted(double value, double offset) noexcept { return value + offset; }
double inverted(double flag, double) noexcept { return 1.0 - flag; }
double other_flags(double flags, double) noexcept { return 7.0 - flags; }

enum Number : std::size_t { stamp, supply, temperature, trip, motor, brake, brake_torque, enable };
/// The brake's torque, for the ideal actuator, fails with the brake's duty.
constexpr std::array<NumberFaults, 8> number_faults{{
    {.garbage_most = 1e12, .whole = true, .wrong = scaled},
    {.garbage_most = 48.0, .wrong = scaled},
    {.off = not_known, .garbage_least = -50.0, .garbage_most = 250.0, .wrong = shifted},
    {.garbage_most = 8.0, .whole = true, .wrong = other_flags, .intermittently_wrong = true},
    {.wrong = scaled_duty},
    {.wrong = scaled_duty},
    {.garbage_most = 10.0, .wrong = scaled},
    {.garbage_most = 2.0, .whole = true, .wrong = inverted},
}};

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

InjectingDriver::InjectingDriver(std::unique_ptr<driver::RigDriver> inner,
                                 const std::vector<config::Injection>& injections, std::uint64_t seed,
                                 PassTime pass_time)
    : inner_(std::move(inner)),
      seed_(seed),
      pass_time_(std::move(pass_time)),
      numbers_{number_faults[stamp], number_faults[supply], number_faults[temperature],  number_faults[trip],
               number_faults[motor], number_faults[brake],  number_faults[brake_torque], number_faults[enable]} {
  for (const config::Injection& injection : injections) planned_.push_back({injection});
}

std::vector<std::string> InjectingDriver::notes() const {
  std::vector<std::string> notes = inner_->notes();
  for (const Planned& planned : planned_) notes.push_back("FAULT INJECTED: " + config::to_text(planned.injection));
  return notes;
}

std::vector<std::string> InjectingDriver::tally() const {
  std::vector<std::string> lines = inner_->tally();
  for (const Planned& planned : planned_) {
    const bool began = planned.entered_ns >= 0 && now_ns_ >= planned.entered_ns + ns_of(planned.injection.delay_s);
    if (!began)
      lines.push_back("the injected fault " + config::to_text(planned.injection) + " never began: the run was over");
  }
  return lines;
}

void InjectingDriver::do_activate(std::int64_t now_ns) {
  inner_->activate(now_ns);
  random_.seed(seed_);
  now_ns_ = now_ns;
  first_effect_ns_ = -1;
  first_read_ = true;
  delivered_ = {};
  passed_ = {};
  for (NumberChannel& number : numbers_) number.start();
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

ActiveFault InjectingDriver::fault_of(config::InjectionSignal signal, config::InjectionSignal or_of) const noexcept {
  // The fault that began last acts. The kind `ok` ends earlier faults.
  std::int64_t latest_ns = -1;
  ActiveFault fault{};
  for (const Planned& planned : planned_) {
    const config::InjectionSignal given = planned.injection.signal;
    if ((given != signal && given != or_of) || planned.entered_ns < 0) continue;
    const std::int64_t begins_ns = planned.entered_ns + ns_of(planned.injection.delay_s);
    const bool over = now_ns_ - begins_ns >= ns_of(std::min(planned.injection.duration_s, longest_run_s));
    if (now_ns_ < begins_ns || over || begins_ns < latest_ns) continue;
    latest_ns = begins_ns;
    fault = {planned.injection.kind, planned.injection.parameter, given};
  }
  return fault;
}

template <class Value, class Garble, class Spoil>
driver::IoResult InjectingDriver::fail_whole(config::InjectionSignal signal, Value& value, const Value& last,
                                             DelayLine<Value>& line, Garble garble, Spoil spoil) noexcept {
  const ActiveFault fault = fault_of(signal);
  if (fault.kind != config::InjectionKind::delayed) line.clear();
  switch (fault.kind) {
    case config::InjectionKind::ok: break;
    case config::InjectionKind::off: return {driver::IoError::no_answer};
    case config::InjectionKind::stuck: value = last; break;
    case config::InjectionKind::garbage: garble(); break;
    case config::InjectionKind::wrong: return spoil(fault.parameter);
    case config::InjectionKind::slow:
      if (pass_time_) pass_time_(ns_of(fault.parameter));
      break;
    case config::InjectionKind::delayed: {
      line.push(now_ns_, value);
      value = last;
      while (line.pop(now_ns_ - ns_of(fault.parameter), value)) {
      }
      break;
    }
    case config::InjectionKind::intermittent:
      if (uniform(random_) < fault.parameter) return {driver::IoError::no_answer};
      break;
  }
  return {};
}

driver::IoResult InjectingDriver::do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept {
  now_ns_ = now_ns;
  // Always read the backend, also under a fault: the read advances an emulator's time.
  if (const driver::IoResult result = inner_->read(now_ns, measurement); !result.ok()) return result;
  if (std::exchange(first_read_, false)) {
    upper_.start(measurement.upper_counts);
    lower_.start(measurement.lower_counts);
    delivered_ = measurement;
  }
  const rig::Measurement sound = measurement;
  fail_encoders(measurement);
  fail_numbers(measurement);
  const auto garble = [&] {
    measurement.upper_counts = any_counts(random_);
    measurement.lower_counts = any_counts(random_);
    measurement.time_ns = static_cast<std::int64_t>(uniform(random_) * number_faults[stamp].garbage_most);
    measurement.supply_V = uniform(random_) * number_faults[supply].garbage_most;
    measurement.trip_flags = static_cast<std::uint32_t>(random_() >> 61U);
    measurement.upper_edge_age_ns = any_counts(random_);
    measurement.lower_edge_age_ns = any_counts(random_);
  };
  const driver::IoResult result =
      fail_whole(config::InjectionSignal::read, measurement, delivered_, answers_, garble,
                 [](double) { return driver::IoResult{driver::IoError::implausible_answer}; });
  note_effect(!result.ok() || differ(sound, measurement) ||
              fault_of(config::InjectionSignal::read).kind == config::InjectionKind::slow);
  if (result.ok()) delivered_ = measurement;
  return result;
}

void InjectingDriver::fail_encoders(rig::Measurement& measurement) noexcept {
  ActiveFault upper = fault_of(config::InjectionSignal::encoder_upper, config::InjectionSignal::encoders);
  ActiveFault lower = fault_of(config::InjectionSignal::encoder_lower, config::InjectionSignal::encoders);
  const rig::Measurement before = delivered_;
  const rig::Measurement sound = measurement;
  const std::int32_t of_upper = upper_.travel(measurement.upper_counts);
  const std::int32_t of_lower = lower_.travel(measurement.lower_counts);
  std::int32_t upper_travel = of_upper;
  std::int32_t lower_travel = of_lower;
  if (upper.swaps()) {
    upper = {};
    upper_travel = of_lower;
    measurement.upper_edge_age_ns = sound.lower_edge_age_ns;
    if (sound.ideal_speeds) measurement.ideal_speeds->omega1_rad_s = sound.ideal_speeds->omega2_rad_s;
  }
  if (lower.swaps()) {
    lower = {};
    lower_travel = of_upper;
    measurement.lower_edge_age_ns = sound.upper_edge_age_ns;
    if (sound.ideal_speeds) measurement.ideal_speeds->omega2_rad_s = sound.ideal_speeds->omega1_rad_s;
  }
  measurement.upper_counts = upper_.pass(upper_travel, upper, now_ns_, random_);
  measurement.lower_counts = lower_.pass(lower_travel, lower, now_ns_, random_);
  // A faulty encoder's edges come at other times, which nobody stamps.
  if (upper.kind != config::InjectionKind::ok) measurement.upper_edge_age_ns = rig::no_edge_age;
  if (lower.kind != config::InjectionKind::ok) measurement.lower_edge_age_ns = rig::no_edge_age;
  if (!measurement.ideal_speeds) return;
  // The true speed holds only for a sound encoder. For a faulty one it is scaled by the counts that are delivered.
  const double dt_s = static_cast<double>(measurement.time_ns - before.time_ns) * 1e-9;
  const auto speed = [&](std::int32_t from, std::int32_t to, std::int32_t travelled, double true_rad_s) {
    const double shown = rig::counts_between(from, to);
    return travelled != 0 && dt_s > 0.0 ? true_rad_s * shown / travelled : (shown == 0.0 ? 0.0 : true_rad_s);
  };
  if (upper.kind != config::InjectionKind::ok) {
    measurement.ideal_speeds->omega1_rad_s =
        speed(before.upper_counts, measurement.upper_counts, upper_travel, measurement.ideal_speeds->omega1_rad_s);
  }
  if (lower.kind != config::InjectionKind::ok) {
    measurement.ideal_speeds->omega2_rad_s =
        speed(before.lower_counts, measurement.lower_counts, lower_travel, measurement.ideal_speeds->omega2_rad_s);
  }
}

void InjectingDriver::fail_numbers(rig::Measurement& measurement) noexcept {
  // A double holds whole ns for 104 days.
  measurement.time_ns =
      static_cast<std::int64_t>(pass(stamp, config::InjectionSignal::stamp, static_cast<double>(measurement.time_ns)));
  measurement.supply_V = pass(supply, config::InjectionSignal::supply, measurement.supply_V);
  measurement.temperature_C = pass(temperature, config::InjectionSignal::temperature, measurement.temperature_C);
  measurement.trip_flags =
      static_cast<std::uint32_t>(pass(trip, config::InjectionSignal::trip, measurement.trip_flags));
}

driver::IoResult InjectingDriver::do_write(const rig::Command& command, rig::Command& sent) noexcept {
  rig::Command passed = command;
  const auto garble = [&] {
    passed.motor_duty = uniform(random_);
    passed.brake_duty = uniform(random_);
    passed.brake_torque_Nm = uniform(random_) * number_faults[brake_torque].garbage_most;
    passed.motor_enable = uniform(random_) < 0.5;
  };
  const auto spoil = [&](double factor) {
    passed.motor_duty = scaled_duty(passed.motor_duty, factor);
    passed.brake_duty = scaled_duty(passed.brake_duty, factor);
    passed.brake_torque_Nm *= factor;
    return driver::IoResult{};
  };
  if (const driver::IoResult lost =
          fail_whole(config::InjectionSignal::write, passed, passed_, commands_, garble, spoil);
      !lost.ok()) {
    note_effect(true);
    return lost;
  }
  passed.motor_duty = pass(motor, config::InjectionSignal::motor_pwm, passed.motor_duty);
  passed.brake_duty = pass(brake, config::InjectionSignal::brake_pwm, passed.brake_duty);
  passed.brake_torque_Nm = pass(brake_torque, config::InjectionSignal::brake_pwm, passed.brake_torque_Nm);
  passed.motor_enable = pass(enable, config::InjectionSignal::enable, passed.motor_enable ? 1.0 : 0.0) > 0.5;
  const bool changed = passed.motor_duty != command.motor_duty || passed.brake_duty != command.brake_duty ||
                       passed.brake_torque_Nm != command.brake_torque_Nm || passed.motor_enable != command.motor_enable;
  note_effect(changed || fault_of(config::InjectionSignal::write).kind == config::InjectionKind::slow);
  passed_ = passed;
  const driver::IoResult result = inner_->write(passed, sent);
  if (result.ok() && changed) sent = inner_->as_sent(command);
  return result;
}

void begin() {
  run::inject_by([](std::unique_ptr<driver::RigDriver> inner, const std::vector<config::Injection>& faults,
                    std::uint64_t seed, runtime::Clock& clock) -> std::unique_ptr<driver::RigDriver> {
    return std::make_unique<InjectingDriver>(std::move(inner), faults, seed, [&clock](std::int64_t duration_ns) {
      clock.sleep_until(clock.now_ns() + duration_ns);
    });
  });
}

}  // namespace abs_hil::injection
