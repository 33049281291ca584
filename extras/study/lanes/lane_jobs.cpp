// Which runs lanes know, and the words of each as it begins.
#include "study/lanes/lane_jobs.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>
#include <variant>

#include "abs_hil/control/registry.hpp"
#include "config/plan.hpp"
#include "driver/factory.hpp"
#include "driver/sim/sim_driver.hpp"
#include "plant_sim/torque_balance.hpp"
#include "rig/encoder_scale.hpp"
#include "runtime/plausibility_limits.hpp"
#include "study/lanes/braking_run.hpp"
#include "study/lanes/lane_kinds.hpp"

namespace abs_hil::study::lanes {

/// The parts of a run that do not depend on its plant.
struct LaneSettings::Parts {
  const config::Settings& settings;
  std::unique_ptr<control::SlipController> controller{};
  LaneSequence<double> sequence{};
  control::SpeedTracker<double> tracker{};
  control::BasicBrakeActuator<double> actuator{};
  std::int64_t period_ns{0};
  double period_s{0.0};
  double duty_steps{0.0};
  std::uint32_t window_cycles{1};
};

namespace {

using experiment::BrakeAction;
using experiment::EndKind;

/// The phases that lanes know: slip control until the car is slow, then at most a constant torque until standstill.
/// False for others.
bool plan_sequence(const config::Plan& plan, const config::Settings& settings, LaneSequence<double>& sequence) {
  if (plan.phases.size() < 2 || plan.limits.distance_m < std::numeric_limits<double>::infinity()) return false;
  const experiment::PhasePlan& brake = plan.phases[0];
  const experiment::PhasePlan& hold = plan.phases[1];
  const auto drives = [](const experiment::PhasePlan& phase) {
    return !phase.motor_duty.zero() || phase.wheels_apart || !phase.question.empty();
  };
  if (drives(brake) || drives(hold)) return false;
  if (brake.phase != rig::Phase::brake || brake.brake != BrakeAction::slip_control || !brake.slip_ref.empty())
    return false;
  if (hold.phase == rig::Phase::brake || !hold.brake_torque_Nm.constant() ||
      (hold.brake != BrakeAction::torque && hold.brake != BrakeAction::released))
    return false;
  for (const experiment::EndCondition& end : brake.ends_on) {
    if (end.kind != EndKind::car_speed_below) return false;
    sequence.slow_m_s = std::max(sequence.slow_m_s, end.value);
  }
  for (const experiment::EndCondition& end : hold.ends_on) {
    if (end.kind != EndKind::standstill) return false;
  }
  sequence.brake_limit_s = brake.time_limit_s;
  sequence.hold_limit_s = hold.time_limit_s;
  sequence.run_limit_s = plan.limits.run_time_s;
  sequence.hold_torque_Nm = hold.brake == BrakeAction::torque ? hold.brake_torque_Nm.at(0.0) : 0.0;
  // The first cycle must not be slow: two slow ones in a row end slip control.
  return settings.model.wheels.r2_m * settings.experiment.start_speed_rad_s > sequence.slow_m_s;
}

/// Cycles of the gate's speed windows; 0 if its checks would not judge often enough.
std::uint32_t cycles_of_window(const LaneSettings::Parts& parts, std::int32_t counts_per_rev) {
  const runtime::GateOptions& gate = parts.settings.gate;
  rig::RigParameters rig;
  rig.encoder_counts_per_rev = counts_per_rev;
  const runtime::SpeedWindows windows(runtime::plausibility_limits(rig, false, gate));
  const std::int64_t least_ns = std::max(runtime::least_speed_window_ns, windows.resolving_ns());
  const std::int64_t cycles = (least_ns + parts.period_ns - 1) / parts.period_ns;
  constexpr std::int64_t most_cycles = 64;
  const double lasts_s = static_cast<double>(cycles * parts.period_ns) * rig::s_per_ns;
  return cycles > most_cycles || lasts_s > gate.judge_within_s ? 0 : static_cast<std::uint32_t>(cycles);
}

/// The checks of the gate, for the rig with this identity.
/// @param cycles  of its speed windows
LaneGate<double> plan_gate(const LaneSettings::Parts& parts, const rig::RigParameters& identity, std::uint32_t cycles) {
  const config::Settings& s = parts.settings;
  const runtime::PlausibilityLimits limits = runtime::plausibility_limits(identity, s.plant.ideal_actuator, s.gate);
  const runtime::SpeedWindows windows(limits);
  return {.watch = runtime::WheelWatch<double>(limits),
          .momentum = runtime::MomentumWatch<double>(limits),
          .upper = {limits.upper_gain_rad_s2, limits.upper_loss_rad_s2, limits.overspeed_rad_s},
          .lower = {limits.lower_gain_rad_s2, limits.lower_loss_rad_s2, limits.overspeed_rad_s},
          .brake = rig::BasicBrake<double>(identity.brake),
          .rad_per_count = limits.rad_per_count,
          .sure_counts = static_cast<double>(windows.sure_counts()),
          .window_s = static_cast<double>(cycles * parts.period_ns) * rig::s_per_ns,
          .overspeed_rad_s = limits.overspeed_rad_s,
          .brake_duty_max = rig::duty_at_most(s.gate.brake_duty_max, static_cast<std::uint32_t>(parts.duty_steps)),
          .brake_rate_per_s = s.gate.brake_rate_per_s,
          .brake_free_duty = identity.brake.u0};
}

}  // namespace

/// A run's plant as it begins.
struct StartingPlant {
  plant_sim::TyreModel tyre;
  double friction_at_most;
  LaneConditions<double> conditions;
  rig::RigParameters identity;  ///< of the gate's limits
};

struct Kind {
  std::size_t words;
  /// Writes the words of the run and begins it. False if the kind does not fit.
  bool (*begin)(const LaneSettings::Parts& parts, const Job& job, const StartingPlant& plant,
                std::vector<double>& words);
  bool (*result)(const double* words, RunResult& result);
  std::array<LaneKernel (*)(), 4> kernels;  ///< by InstructionSet
};

namespace {

template <template <class> class Law, template <class> class Tyre, template <class> class Load>
struct KindOf {
  using Run = BrakingRun<double, Law, Tyre, Load>;

  static bool begin(const LaneSettings::Parts& parts, const Job& job, const StartingPlant& plant,
                    std::vector<double>& words) {
    const auto* controller = dynamic_cast<const control::LawController<Law>*>(parts.controller.get());
    if (controller == nullptr) return false;
    if constexpr (requires { controller->law().has_lanes(); }) {
      if (!controller->law().has_lanes()) return false;
    }
    const auto* const tyre = std::get_if<Tyre<double>>(&plant.tyre);
    if (tyre == nullptr) return false;
    const auto loads = plant_sim::make_load_model(job.plant, tyre->peak_mu(), plant.friction_at_most);
    const auto* const load = std::get_if<Load<double>>(&loads);
    if (load == nullptr) return false;
    const rig::RigParameters& model = parts.settings.model;
    Run run;
    run.rig.tyre = *tyre;
    run.rig.load = *load;
    run.rig.now = plant.conditions;
    run.rig.max_step_s = job.plant.max_step_s;
    run.rig.brake = rig::BasicBrake<double>(job.plant.rig.brake);
    run.rig.ideal_brake = job.plant.ideal_actuator ? 1.0 : 0.0;
    run.ideal_sensors = job.plant.ideal_sensors ? 1.0 : 0.0;
    if (!job.plant.ideal_sensors)
      run.disc_error_rad = experiment::unlearnt_disc_rad(parts.settings.control.observer, model);
    run.rig.rad_per_count = rig::radians_per_count(job.plant.rig.encoder_counts_per_rev);
    const driver::CountOffsets offsets = driver::count_offsets(job.seed, run.rig.rad_per_count);
    run.rig.upper_offset_rad = offsets.upper_rad;
    run.rig.lower_offset_rad = offsets.lower_rad;
    run.rig.duty_steps = parts.duty_steps;
    run.gate = plan_gate(parts, plant.identity, parts.window_cycles);
    run.sequence = parts.sequence;
    run.law = controller->law();
    run.upper.tracker = run.lower.tracker = parts.tracker;
    run.actuator = parts.actuator;
    run.figures = analysis::BrakingFigures<double>(parts.settings.experiment.end_speed_m_s);
    run.r1_m = model.wheels.r1_m;
    run.r2_m = model.wheels.r2_m;
    run.slip_ref = parts.settings.control.slip_ref;
    run.period_s = parts.period_s;
    run.period_ns = static_cast<double>(parts.period_ns);
    run.begin(parts.settings.experiment.start_speed_rad_s);
    if (run.disturbed != 0.0) return false;
    words.resize(sizeof(Run) / sizeof(double));
    std::memcpy(words.data(), static_cast<const void*>(&run), sizeof(Run));
    return true;
  }
  static bool result(const double* words, RunResult& result) {
    Run run;
    std::memcpy(static_cast<void*>(&run), words, sizeof(Run));
    if (run.disturbed != 0.0) return false;
    result = {.metrics = analysis::metrics_of(run.figures)};
    return true;
  }

  using Types = LaneKind<Law, Tyre, Load>;
#ifdef ABS_HIL_WIDE_LANES
  static constexpr std::array<LaneKernel (*)(), 4> kernels{
      nullptr, lane_kernel<rig::Portable, Types>, lane_kernel<rig::Avx2, Types>, lane_kernel<rig::Avx512, Types>};
#else
  static constexpr std::array<LaneKernel (*)(), 4> kernels{nullptr, lane_kernel<rig::Portable, Types>};
#endif
  static constexpr Kind kind{sizeof(Run) / sizeof(double), begin, result, kernels};
};

#define ABS_HIL_LANE_KIND(law, tyre, load) &KindOf<law, tyre, load>::kind,
constexpr const Kind* kinds[] = {ABS_HIL_LANE_KINDS(ABS_HIL_LANE_KIND)};
#undef ABS_HIL_LANE_KIND

bool changes(const plant_sim::PlantOptions& plant) {
  const plant_sim::DriftProfiles& drift = plant.drift;
  return !plant.friction_profile.empty() || !drift.brake_torque.empty() || !drift.motor_torque.empty() ||
         !drift.upper_bearing.empty() || !drift.lower_bearing.empty();
}

/// @param time_ns  of the conditions
LaneConditions<double> lane_conditions(const plant_sim::PlantConditions& now, double time_ns) {
  // Far above all rounding: the cycle in which something changes is assisted, and sometimes the one before.
  constexpr double early_ns = 1000.0;
  constexpr double early_rad = 1e-6;
  return {.wheels = plant_sim::BasicWheels<double>(now.wheels),
          .friction = now.friction,
          .brake_torque = now.brake_torque,
          .steady_to_ns = time_ns + now.steady_s * 1e9 - early_ns,
          .steady_to_angle2_rad = now.steady_to_angle2_rad - early_rad};
}

std::unique_ptr<plant_sim::Plant> started_plant(const plant_sim::PlantOptions& options) {
  auto plant = std::make_unique<plant_sim::Plant>(options);
  plant->reset({});
  return plant;
}

bool eccentric(const rig::RigParameters& rig) {
  return rig.upper_encoder.eccentricity_rad > 0.0 || rig.lower_encoder.eccentricity_rad > 0.0;
}

/// Flaws of brake and encoders, which lanes do not know.
bool flawed(const plant_sim::PlantOptions& plant) {
  return plant.rig.brake.brake_rate_limit_Nm_s > 0.0 || plant.rig.brake.brake_dead_time_s > 0.0 ||
         plant.brake_flaws != plant_sim::BrakeFlaws{} || eccentric(plant.rig) || plant.encoder_eccentricity_rad > 0.0 ||
         plant.upper_encoder_flaws != plant_sim::EncoderFlaws{} ||
         plant.lower_encoder_flaws != plant_sim::EncoderFlaws{};
}

/// Integrates the plant over a cycle that lanes cannot compute.
void assist(void* runs, const AssistedCycle& cycle, double* state, double* conditions) {
  Started& run = static_cast<Started*>(runs)[cycle.run];
  if (!run.plant) run.plant = started_plant(run.job.plant);
  const auto cycles = std::llround(cycle.time_ns * rig::s_per_ns / cycle.duration_s);
  plant_sim::StateVector x{};
  std::copy_n(state, x.size(), x.begin());
  run.plant->take_over(plant_sim::state_of(x), cycle.duration_s, cycles - 1 - run.plant_cycles);
  run.plant->advance(cycle.duration_s, {.brake_duty = cycle.duty, .brake_torque_Nm = cycle.brake_torque_Nm});
  run.plant_cycles = cycles;
  x = plant_sim::vector_of(run.plant->state());
  std::copy(x.begin(), x.end(), state);
  const LaneConditions<double> now = lane_conditions(run.plant->conditions(), cycle.time_ns);
  std::memcpy(conditions, &now, sizeof(now));
}

}  // namespace

InstructionSet instruction_set() {
  InstructionSet widest = InstructionSet::portable;
#ifdef ABS_HIL_WIDE_LANES
  if (__builtin_cpu_supports("avx2") != 0) widest = InstructionSet::avx2;
  if (__builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512dq") != 0)
    widest = InstructionSet::avx512;
#endif
  const char* wanted = std::getenv("ABS_HIL_LANES");  // NOLINT(concurrency-mt-unsafe)
  if (wanted == nullptr || *wanted == '\0') return widest;
  constexpr const char* names[] = {"none", "portable", "avx2", "avx512"};
  for (std::size_t i = 0; i < std::size(names); ++i) {
    if (std::string(wanted) != names[i]) continue;
    if (i > static_cast<std::size_t>(widest)) {
      throw std::invalid_argument(std::string("ABS_HIL_LANES=") + wanted + ": this computer has no " + wanted +
                                  "; leave ABS_HIL_LANES out");
    }
    return static_cast<InstructionSet>(i);
  }
  throw std::invalid_argument(std::string("ABS_HIL_LANES=") + wanted + ": give avx512, avx2, portable or none");
}

LaneSettings::LaneSettings(const config::Settings& settings) {
  const double start_speed_rad_s = settings.experiment.start_speed_rad_s;
  if (settings.experiment.wait_for_start || !(start_speed_rad_s > 0.0) || eccentric(settings.model)) return;
  if (control::is_controller_file(settings.control.controller)) return;  // its code is not a law over a scalar
  if (settings.model.brake.brake_dead_time_s > 0.0) return;              // lanes keep no duties on their way
  auto parts = std::make_unique<Parts>(Parts{.settings = settings});
  try {
    const run::Prepared prepared(settings);
    parts->controller = control::make_controller(settings.control.controller, {settings.control, settings.model});
    if (!plan_sequence(prepared.plan, settings, parts->sequence)) return;
    parts->period_ns = prepared.period_ns;
    parts->duty_steps = config::output_grid(prepared.settings, settings.plant).duty_steps;
  } catch (const std::exception&) {
    return;  // `simulate` says what is wrong
  }
  parts->period_s = static_cast<double>(parts->period_ns) * rig::s_per_ns;
  parts->window_cycles = cycles_of_window(*parts, settings.plant.rig.encoder_counts_per_rev);
  if (parts->window_cycles == 0) return;
  parts->tracker = {settings.control.observer, settings.model.encoder_counts_per_rev};
  parts->tracker.prepare(parts->period_s);
  if (parts->tracker.must_restart()) return;
  parts->actuator = {settings.model.brake, settings.plant.ideal_actuator, settings.gate.brake_duty_max,
                     static_cast<std::uint32_t>(parts->duty_steps)};
  parts->actuator.prepare(parts->period_s);
  parts_ = std::move(parts);
}

LaneSettings::~LaneSettings() = default;

std::uint32_t LaneSettings::window_cycles() const noexcept { return parts_ ? parts_->window_cycles : 0; }

const Kind* LaneSettings::begin(Started& run) const {
  const plant_sim::PlantOptions& plant = run.job.plant;
  if (!parts_ || flawed(plant)) return nullptr;
  // The controller would take an ideal brake for a real one, or the other way round.
  if (plant.ideal_actuator != parts_->settings.plant.ideal_actuator) return nullptr;
  try {
    plant_sim::check(plant);
    // Runs of one set of settings go through the kernels together: their speed windows end together.
    const std::int32_t counts_per_rev = plant.rig.encoder_counts_per_rev;
    if (counts_per_rev != parts_->settings.plant.rig.encoder_counts_per_rev &&
        cycles_of_window(*parts_, counts_per_rev) != parts_->window_cycles)
      return nullptr;
    StartingPlant starting{plant_sim::make_tyre_model(plant),
                           1.0,
                           {.wheels = plant_sim::BasicWheels<double>(plant.rig.wheels)},
                           plant_sim::identity_of(plant)};
    if (changes(plant)) {
      run.plant = started_plant(plant);
      starting.friction_at_most = plant_sim::FactorProfile(plant.friction_profile).highest();
      starting.conditions = lane_conditions(run.plant->conditions(), 0.0);
    }
    for (const Kind* kind : kinds) {
      if (kind->begin(*parts_, run.job, starting, run.words)) return kind;
    }
  } catch (const std::exception&) {
    // `simulate` says what is wrong.
  }
  return nullptr;
}

void go_on(const Kind& kind, InstructionSet set, std::span<Started> runs, std::uint32_t window_cycles) {
  std::vector<double*> words;
  for (Started& run : runs) words.push_back(run.words.data());
  std::vector<std::uint32_t> next(runs.size());
  kind.kernels[static_cast<std::size_t>(set)]()({.runs = words.data(),
                                                 .next = next.data(),
                                                 .count = static_cast<std::uint32_t>(runs.size()),
                                                 .window_cycles = window_cycles,
                                                 .assist = &assist,
                                                 .context = runs.data()});
}

bool result_of(const Kind& kind, const double* words, RunResult& result) { return kind.result(words, result); }

}  // namespace abs_hil::study::lanes
