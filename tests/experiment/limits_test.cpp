// The limits belong to the rig. What a run's keys and its model say takes no protection away: every key is taken to the
// ends of its range, and either the policy of a real board refuses it, or ten faults are found as soon as without it.

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "catch.hpp"
#include "config/board_policy.hpp"
#include "config/config_error.hpp"
#include "config/key_table.hpp"
#include "injected_run.hpp"

using namespace abs_hil;
using namespace abs_hil::experiment;
using namespace abs_hil::experiment::test;

namespace {

struct Fault {
  std::string text;
  double bound_s;  ///< docs/safety.md, "What is found, and how soon", at 1 kHz
};

/// 2 s into the acceleration the wheels turn at about 70 rad/s.
std::vector<Fault> ten_faults(double rate_Hz) {
  const std::string slow = "accelerate@read:slow=" + std::to_string(3.0 / rate_Hz) + "s+2s";
  return {{"accelerate@encoder_lower:stuck+2s", 0.01}, {"accelerate@encoder_upper:stuck+2s", 0.25},
          {"accelerate@encoders:stuck+2s", 0.25},      {"accelerate@encoder_lower:wrong+2s", 0.01},
          {"accelerate@stamp:stuck+2s", 0.025},        {"accelerate@motor_pwm:off+2s", 0.5},
          {"accelerate@trip:wrong+2s", 0.002},         {"accelerate@temperature:garbage+2s", 0.03},
          {"brake@encoder_upper:stuck+0.1s", 0.5},     {slow, 0.16 + 4.0 / rate_Hz}};
}

/// Time with an output on from the fault until it is found, while the wheels turn fast enough for the checks to judge
/// them, s.
double exposure_s(const config::Settings& s, const std::string& fault) {
  constexpr double judged_rad_s = 15.0;
  constexpr double longest_s = 130.0;
  const Setup setup{
      .plant = s.plant, .control = s.control, .experiment = s.experiment, .gate = s.gate, .model = s.model};
  const config::Injection injection = config::parse_injection(fault);
  runtime::VirtualClock clock;
  injection::InjectingDriver driver(
      std::make_unique<driver::SimDriver>(setup.plant, driver::SimStart{.seed = 1}), {injection}, 1,
      [&clock](std::int64_t duration_ns) { clock.sleep_until(clock.now_ns() + duration_ns); });
  Recorder recorder;
  SetupRun run(setup, {.clock = &clock, .driver = &driver, .overruns = s.realtime.overruns});
  run->record_into({&recorder});
  static_cast<void>(run->go([&] {
    const bool too_long = static_cast<double>(clock.now_ns()) * 1e-9 > longest_s;
    return too_long ? rig::Reason::stop_command : rig::Reason::none;
  }));
  const bool of_motor = fault.find("motor_pwm") != std::string::npos;
  double begins_s = -1.0;
  double exposed_s = 0.0;
  double before_s = 0.0;
  for (const rig::CycleRecord& r : recorder.records) {
    if (begins_s < 0.0 && r.phase == injection.phase) begins_s = r.time_s + injection.delay_s;
    const bool found = r.phase == rig::Phase::fault;  // gate.fault_brake_duty may brake then
    // A run that is fast enough before the fault brakes by then: a motor that is not driven cannot show that it is off.
    const bool braked = r.command.brake_duty > 0.0 && !of_motor;
    const bool acts = !found && (r.command.motor_duty > 0.0 || braked);
    if (begins_s >= 0.0 && r.time_s > begins_s && acts && r.truth.speeds.omega2_rad_s > judged_rad_s)
      exposed_s += r.time_s - before_s;
    before_s = r.time_s;
  }
  return exposed_s;
}

/// The bound in cycles of this rate: windows and late cycles are longer in slower ones. Old samples count for as long
/// as `gate.sample_age_max_s` says.
double bound_s(const Fault& fault, const config::Settings& s) {
  const double rate_Hz = s.control.rate_Hz;
  const double window_s = std::ceil(1.8e-3 * rate_Hz) / rate_Hz;
  const bool is_of_age = fault.text.find("stamp") != std::string::npos;
  const double older_s =
      is_of_age ? std::max(0.0, s.gate.sample_age_max_s - runtime::GateOptions{}.sample_age_max_s) : 0.0;
  return fault.bound_s + older_s + 4.0 * std::max(0.0, window_s - 2e-3) + 1.0 / rate_Hz;
}

std::string digits_of(double value) {
  char digits[40];
  std::snprintf(digits, sizeof(digits), "%.17g", value);
  return digits;
}

/// Texts of the values at the ends of a key's range, and of the weakest one that a board takes without a consent.
std::vector<std::string> ends_of(const config::Key& key) {
  if (std::holds_alternative<bool*>(key.target)) return {"true", "false"};
  if (std::holds_alternative<std::string*>(key.target)) {
    std::vector<std::string> names;
    for (const std::string_view name : key.allowed.list()) names.emplace_back(name);
    return names;
  }
  const bool whole = !std::holds_alternative<double*>(key.target);
  const double inside = whole ? 0.0 : 1e-6 * std::min(1.0, key.range.most - key.range.least);
  std::vector<std::string> ends{digits_of(key.range.least + inside), digits_of(key.range.most - inside)};
  using Kind = rig::SafetyClass::Kind;
  if (key.safety.kind == Kind::above || key.safety.kind == Kind::below) ends.push_back(digits_of(key.safety.bound));
  return ends;
}

/// True for a key that bears on the cycle of the default controller in this test.
bool acts_here(const std::string& name) {
  const auto begins = [&name](const char* start) { return name.starts_with(start); };
  if (begins("control.")) {
    const bool of_a_law = name.find('.', 8) != std::string::npos;
    return !of_a_law || begins("control.adaptive.") || begins("control.observer.");
  }
  return begins("model.") || begins("gate.") || begins("realtime.") || begins("experiment.");
}

bool refused_on_a_board(const config::Settings& s, const config::KeyTable& keys) {
  try {
    static_cast<void>(config::refuse_unsafe_use(s, config::safety_view(s, keys, {}), false));
  } catch (const std::invalid_argument&) {
    return true;
  }
  return false;
}

/// A model that believes so many times what the rig is.
config::Settings with_model(double theta, double motor, double brake, double inertia) {
  config::Settings s;
  s.model.tyre.theta_N *= theta;
  s.model.motor.stall_torque_Nm *= motor;
  s.model.brake.b1_Nm *= brake;
  s.model.brake.b2_Nm *= brake;
  s.model.wheels.J1_kg_m2 *= inertia;
  s.model.wheels.J2_kg_m2 *= inertia;
  return s;
}

}  // namespace

TEST_CASE("a model of any size hides no fault") {
  for (const config::Settings& s :
       {with_model(1.0, 1.0, 1.0, 1.0), with_model(20.0, 1.0, 1.0, 1.0), with_model(0.01, 1.0, 1.0, 1.0),
        with_model(1.0, 0.001, 1.0, 1.0), with_model(1.0, 40.0, 1.0, 1.0), with_model(1.0, 1.0, 10.0, 1.0),
        with_model(1.0, 1.0, 1.0, 0.02), with_model(1.0, 1.0, 1.0, 30.0)}) {
    for (const Fault& fault : ten_faults(s.control.rate_Hz)) {
      CAPTURE(fault.text, s.model.tyre.theta_N, s.model.motor.stall_torque_Nm, s.model.brake.b1_Nm,
              s.model.wheels.J1_kg_m2);
      CHECK(exposure_s(s, fault.text) <= bound_s(fault, s));
    }
  }
}

TEST_CASE("overspeed is found by the counts alone, however slow the observers are") {
  config::Settings s;
  s.control.observer.bandwidth_rad_s = 10.0;
  s.gate.overspeed_rad_s = 100.0;
  const Setup setup{.plant = s.plant, .control = s.control, .gate = s.gate};
  const InjectedResult run = run_injected(setup, {});
  CHECK(run.outcome.reason == rig::Reason::overspeed);
  CHECK(run.records.back().truth.speeds.omega2_rad_s < 100.0 / (1.0 - 150e-6 / 1.85e-3) + 5.0);
}

TEST_CASE("no set of values that a board takes hides a fault") {
  config::Settings defaults;
  const config::KeyTable table(defaults);
  std::vector<const config::Key*> drawn;
  for (const config::Key& key : table.keys()) {
    if (acts_here(key.name) && std::holds_alternative<double*>(key.target)) drawn.push_back(&key);
  }
  std::mt19937_64 random(36);
  int runs = 0;
  for (int set = 0; set < 40; ++set) {
    std::vector<std::string> values;
    const auto settings_with = [&](const std::string& last, config::Settings& s) {
      config::KeyTable keys(s);
      for (const std::string& value : values) keys.set_text(value, "test");
      keys.set_text(last, "test");
      return !refused_on_a_board(s, keys);
    };
    while (values.size() < 6) {
      const config::Key& key = *drawn[std::uniform_int_distribution<std::size_t>(0, drawn.size() - 1)(random)];
      // Half of them within a factor of three of the default, where runs are possible; the others anywhere.
      const double share = std::uniform_real_distribution<double>(0.0, 1.0)(random);
      const double near = **std::get_if<double*>(&key.target) * std::pow(3.0, 2.0 * share - 1.0);
      const double anywhere = key.range.least + share * (key.range.most - key.range.least);
      const std::string value = key.name + '=' + digits_of(values.size() % 2 == 0 ? near : anywhere);
      try {
        config::Settings s;
        if (settings_with(value, s)) values.push_back(value);
      } catch (const config::ConfigError&) {
      }
    }
    config::Settings s;
    static_cast<void>(settings_with(values.back(), s));
    for (const Fault& fault : ten_faults(s.control.rate_Hz)) {
      CAPTURE(values, fault.text);
      try {
        const double exposed_s = exposure_s(s, fault.text);
        ++runs;
        CHECK(exposed_s <= bound_s(fault, s));
      } catch (const std::invalid_argument&) {
      }
    }
  }
  CHECK(runs >= 200);
}

TEST_CASE("every key at its ends is refused on a board, or ten faults are found as soon") {
  config::Settings defaults;
  const config::KeyTable table(defaults);
  int refused = 0, run = 0;
  for (const config::Key& described : table.keys()) {
    if (!acts_here(described.name)) continue;
    for (const std::string& value : ends_of(described)) {
      config::Settings s;
      config::KeyTable keys(s);
      try {
        keys.set_text(described.name + '=' + value, "test");
      } catch (const config::ConfigError&) {
        continue;
      }
      if (refused_on_a_board(s, keys)) {
        ++refused;
        continue;
      }
      ++run;
      for (const Fault& fault : ten_faults(s.control.rate_Hz)) {
        CAPTURE(described.name, value, fault.text);
        double exposed_s = 0.0;
        try {
          exposed_s = exposure_s(s, fault.text);
        } catch (const std::invalid_argument&) {
          continue;  // no run begins with this value beside the others' defaults
        }
        CHECK(exposed_s <= bound_s(fault, s));
      }
    }
  }
  CHECK(refused >= 20);
  CHECK(run >= 100);
}
