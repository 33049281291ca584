// Random campaigns of faults, on the virtual clock: any faults at any times, any rate, reads of any length, wrong
// models. RapidCheck shrinks a failing case and prints it; RC_PARAMS="seed=... max_success=2000" repeats or lengthens a
// campaign.

#include <rapidcheck.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "catch.hpp"
#include "config/injection.hpp"
#include "experiment/injected_run.hpp"

using namespace abs_hil;
using namespace abs_hil::experiment;
using namespace abs_hil::experiment::test;

namespace {

using config::InjectionKind;
using config::InjectionSignal;

/// One case. RapidCheck shrinks every number towards 0: no fault, the first rate, short reads, the right model.
struct Case {
  std::vector<config::Injection> faults{};
  double rate_Hz{1000.0};
  double read_share{0.0};   ///< duration of each read as a part of the period
  double model_error{0.0};  ///< relative, of J1, J2, c31 or the brake map
  int wrong_parameter{0};
  std::uint64_t seed{1};
};

std::string text_of(const Case& c) {
  std::string text = "rate " + std::to_string(c.rate_Hz) + " Hz, reads take " + std::to_string(c.read_share) +
                     " of a period, seed " + std::to_string(c.seed) + ", model parameter " +
                     std::to_string(c.wrong_parameter) + " wrong by " + std::to_string(c.model_error) + ", faults";
  for (const config::Injection& fault : c.faults) text.append(" ").append(config::to_text(fault));
  return text;
}

template <class T>
T one_of(const std::vector<T>& choices) {
  return choices[*rc::gen::inRange<std::size_t>(0, choices.size())];
}

config::Injection any_fault() {
  config::Injection fault = config::parse_injection(
      std::string(rig::name_of(one_of<rig::Phase>({rig::Phase::brake, rig::Phase::hold, rig::Phase::stopped}))) + '@' +
      std::string(config::name_of(
          static_cast<InjectionSignal>(*rc::gen::inRange(0, static_cast<int>(config::injection_signal_count))))) +
      ':' +
      std::string(config::name_of(
          static_cast<InjectionKind>(*rc::gen::inRange(0, static_cast<int>(config::injection_kind_count))))));
  // The checks know a wheel only once it has been seen turning: a run that begins at speed begins without faults.
  fault.delay_s = *rc::gen::inRange(50, 2000) * 1e-3;
  if (*rc::gen::arbitrary<bool>()) fault.duration_s = *rc::gen::inRange(1, 500) * 1e-3;
  return fault;
}

Case any_case() {
  Case c;
  const int faults = *rc::gen::inRange(0, 4);
  for (int n = 0; n < faults; ++n) c.faults.push_back(any_fault());
  c.rate_Hz = one_of<double>({1000.0, 100.0, 250.0, 500.0, 2000.0, 10'000.0});
  c.read_share = one_of<double>({0.0, 0.4, 0.55, 0.7, 0.95});
  c.model_error = one_of<double>({0.0, 0.2, -0.2});
  c.wrong_parameter = *rc::gen::inRange(0, 4);
  c.seed = static_cast<std::uint64_t>(*rc::gen::inRange(1, 1'000'000));
  return c;
}

void make_wrong(rig::RigParameters& model, const Case& c) {
  const double factor = 1.0 + c.model_error;
  switch (c.wrong_parameter) {
    case 0: model.wheels.J1_kg_m2 *= factor; break;
    case 1: model.wheels.J2_kg_m2 *= factor; break;
    case 2: model.brake.c31_per_s *= factor; break;
    default: model.brake.b1_Nm *= factor; model.brake.b2_Nm *= factor;
  }
}

InjectedResult run_case(const Case& c) {
  Setup setup = braking("adaptive");
  setup.control.rate_Hz = c.rate_Hz;
  setup.seed = c.seed;
  setup.model = setup.plant.rig;
  make_wrong(*setup.model, c);
  std::vector<config::Injection> faults = c.faults;
  if (c.read_share > 0.0) faults.push_back(slow_reads(c.read_share, c.rate_Hz));
  return run_injected(setup, faults);
}

bool finite(const rig::CycleRecord& r) {
  const std::array values{r.command.motor_duty,
                          r.command.brake_duty,
                          r.command.brake_torque_Nm,
                          r.control.speeds_est.omega1_rad_s,
                          r.control.speeds_est.omega2_rad_s,
                          r.control.slip_est,
                          r.control.brake_torque_ref_Nm,
                          r.control.brake_torque_est_Nm};
  return std::ranges::all_of(values, [](double value) { return std::isfinite(value); });
}

bool releases(const rig::Command& command) { return command.motor_duty == 0.0 && command.brake_duty == 0.0; }

/// True for a fault after which counts no longer follow a wheel at all.
bool blinds(const config::Injection& fault) {
  const bool encoder = fault.signal == InjectionSignal::encoder_upper ||
                       fault.signal == InjectionSignal::encoder_lower || fault.signal == InjectionSignal::encoders;
  const bool kind =
      fault.kind == InjectionKind::off || fault.kind == InjectionKind::stuck || fault.kind == InjectionKind::garbage;
  return encoder && kind && fault.phase == rig::Phase::brake && !(fault.duration_s < 1e9);
}

constexpr double r2_m = 0.099;
/// docs/safety.md, "What is found, and how soon": an encoder that does not follow its wheel, and what slow reads add.
constexpr double encoder_s = 0.5;
constexpr double slow_reads_add_s = 0.3;
/// Below this speed a stuck encoder looks like a wheel about to stop.
constexpr double judged_m_s = 3.0;

/// Braking time, with the car faster than `judged_m_s`, after the first fault that blinds an encoder, s.
double braked_blind_s(const Case& c, const InjectedResult& run) {
  double start_s = -1.0;
  for (const rig::CycleRecord& r : run.records) {
    if (r.phase == rig::Phase::brake) {
      start_s = r.time_s;
      break;
    }
  }
  if (start_s < 0.0) return 0.0;
  double longest_s = 0.0;
  for (const config::Injection& fault : c.faults) {
    if (!blinds(fault)) continue;
    const double from_s = start_s + fault.delay_s;
    for (const rig::CycleRecord& r : run.records) {
      const bool braking = r.phase == rig::Phase::brake && r2_m * r.truth.speeds.omega2_rad_s > judged_m_s;
      if (braking && r.time_s > from_s) longest_s = std::max(longest_s, r.time_s - from_s);
    }
  }
  return longest_s;
}

/// As the program judges a run on a real rig, where only the estimates are known.
bool stops(const InjectedResult& run) {
  analysis::RunMetrics metrics(r2_m, ExperimentOptions{}.end_speed_m_s);
  for (rig::CycleRecord record : run.records) {
    record.truth = {};
    metrics.consume(record, 0.0);
  }
  return run.outcome.completed() && !metrics.moves_on();
}

void check_case(const Case& c) {
  RC_LOG() << text_of(c) << '\n';
  const InjectedResult run = run_case(c);
  RC_ASSERT(!run.records.empty());
  RC_ASSERT(run.outputs.motor_duty == 0.0 && run.outputs.brake_duty == 0.0);
  RC_ASSERT(run.outcome.safe_state.ok() || !run.outcome.completed());
  int after_fault = 0;
  for (const rig::CycleRecord& r : run.records) {
    RC_ASSERT(finite(r));
    if (rig::is_fault(r.reason) || after_fault > 0) ++after_fault;
    if (after_fault > 2) RC_ASSERT(releases(r.command));
  }
  if (stops(run)) {
    const rig::CycleRecord& last = run.records.back();
    RC_LOG() << "completed, with the car at " << r2_m * last.truth.speeds.omega2_rad_s << " m/s\n";
    RC_ASSERT(std::abs(r2_m * last.truth.speeds.omega2_rad_s) < 0.3);
  }
  const double allowed_s = encoder_s + (c.read_share > 0.0 ? slow_reads_add_s : 0.0) + 3.0 / c.rate_Hz;
  const double blind_s = braked_blind_s(c, run);
  RC_LOG() << "braked " << blind_s << " s with a blind encoder\n";
  RC_ASSERT(blind_s <= allowed_s);
}

}  // namespace

TEST_CASE("random faults at random times never leave the rig unsafe, unseen or falsely stopped") {
  CHECK(rc::check("campaign", [] { check_case(any_case()); }));
}
