// Runs in lanes have the bits of runs alone, for every law of ours, plant and road.
#include <bit>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

#include "abs_hil/control/registry.hpp"
#include "abs_hil/control/slip_error_dynamics.hpp"
#include "catch.hpp"
#include "config/config_file.hpp"
#include "config/key_table.hpp"
#include "config/script.hpp"
#include "study/batch.hpp"
#include "study/lanes/lane_jobs.hpp"
#include "study/variation.hpp"

using namespace abs_hil;
using namespace abs_hil::study;

namespace {

/// Chooses the lanes of `run_batch` as a user does.
class Lanes {
 public:
  explicit Lanes(const char* set) { setenv("ABS_HIL_LANES", set, 1); }
  ~Lanes() { unsetenv("ABS_HIL_LANES"); }
  Lanes(const Lanes&) = delete;
  Lanes& operator=(const Lanes&) = delete;
};

/// The instruction sets that this computer has.
std::vector<const char*> sets() {
  std::vector<const char*> all{"portable"};
  for (const char* set : {"avx2", "avx512"}) {
    const Lanes lanes(set);
    try {
      static_cast<void>(lanes::instruction_set());
      all.push_back(set);
    } catch (const std::invalid_argument&) {
    }
  }
  return all;
}

bool same_bits(const RunResult& a, const RunResult& b) {
  for (const analysis::Figure& figure : analysis::figures) {
    const double x = figure.of(a.metrics);
    const double y = figure.of(b.metrics);
    if (std::bit_cast<std::uint64_t>(x) != std::bit_cast<std::uint64_t>(y) && !(std::isnan(x) && std::isnan(y)))
      return false;
  }
  return a.fault == b.fault;
}

/// A user's controller, written for `double` alone, as docs/writing-a-controller.md shows it.
class OwnController final : public control::SlipController {
 public:
  explicit OwnController(const control::ControllerContext& context) : wheels_{context.rig.wheels} {}
  void reset(const control::SlipInput& /*input*/) noexcept override {}
  [[nodiscard]] control::SlipOutput step(const control::SlipInput& input) noexcept override {
    return {.brake_torque_Nm = 2.0 + 10.0 * (input.slip_ref - input.slip),
            .slip_velocity_error_m_s = control::slip_velocity_error_m_s(wheels_, input.speeds, input.slip_ref),
            .theta_est_N = rig::unknown};
  }

 private:
  rig::WheelParameters wheels_;
};
constexpr const char* own_name = "own-controller";
const bool registered =
    (control::register_controller(control::controller_entry<OwnController>(own_name, "of a user")), true);

struct Case {
  config::Settings settings;
  Job job;
};

config::Settings settings_of(const std::string& plant) {
  config::Settings settings;
  config::KeyTable keys(settings);
  config::load_file(config::plant_file(plant), keys, config::Tables::of_plant);
  return settings;
}

/// A random profile: `axis`, a first value, and up to four jumps and ramps over 0 to `length`.
std::string drawn_profile(std::mt19937_64& generator, const std::string& axis, double length) {
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  const auto value = [&] { return std::to_string(0.4 + 0.6 * uniform(generator)); };
  std::string text = axis + ": " + value();
  double at = 0.0;
  for (auto changes = generator() % 5; changes > 0; --changes) {
    at += 0.3 * length * uniform(generator) + 0.01;
    const std::string begin = std::to_string(at);
    if (uniform(generator) < 0.7) {
      text += "; " + value() + " at " + begin;
    } else {
      at += 0.2 * length * uniform(generator) + 0.01;
      text += "; " + value() + " from " + begin + " to " + std::to_string(at);
    }
  }
  return text;
}

/// Roads and drifts of all kinds.
void draw_conditions(std::mt19937_64& generator, plant_sim::PlantOptions& plant) {
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  const auto chance = [&](double p) { return uniform(generator) < p; };
  if (chance(0.8)) {
    const bool time = chance(0.5);
    plant.friction_profile = drawn_profile(
        generator, std::string(chance(0.5) ? "braking " : "") + (time ? "time" : "distance"), time ? 2.0 : 15.0);
  }
  for (std::string* drift :
       {&plant.drift.brake_torque, &plant.drift.motor_torque, &plant.drift.upper_bearing, &plant.drift.lower_bearing}) {
    if (chance(0.2)) *drift = drawn_profile(generator, chance(0.5) ? "braking time" : "time", 2.0);
  }
}

/// Up to `most` times as large or small.
void scale(std::mt19937_64& generator, double& value, double most) {
  value *= std::exp(std::log(most) * std::uniform_real_distribution<double>(-1.0, 1.0)(generator));
}

/// Random settings of everything that `compare` and studies vary, and of much that they do not.
Case drawn_case(std::mt19937_64& generator, const std::vector<config::Settings>& plants) {
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  const auto chance = [&](double p) { return uniform(generator) < p; };
  Case c{plants[generator() % plants.size()], {}};
  config::Settings& s = c.settings;
  const auto controllers = control::controllers();
  s.control.controller = controllers[generator() % controllers.size()].name;
  if (chance(0.4)) s.control.controller = "adaptive";
  s.experiment.start_speed_rad_s = 20.0 + 200.0 * uniform(generator);
  if (chance(0.3)) s.experiment.end_speed_m_s = 0.05 + 5.0 * uniform(generator);
  if (chance(0.3)) s.control.slip_ref = 0.02 + 0.3 * uniform(generator);
  if (chance(0.3)) scale(generator, s.control.adaptive.gamma, 10.0);
  if (chance(0.2)) scale(generator, s.control.adaptive.ks1, 4.0);
  if (chance(0.2)) scale(generator, s.control.adaptive.ka1, 10.0);
  if (chance(0.2)) scale(generator, s.control.sliding_mode.gain_m_s2, 2.0);
  if (chance(0.2)) scale(generator, s.control.observer.bandwidth_rad_s, 4.0);
  if (chance(0.15)) s.control.rate_Hz = 200.0 + 2800.0 * uniform(generator);
  if (chance(0.15)) s.model.encoder_counts_per_rev = 512 << (generator() % 6);
  if (chance(0.15)) s.driver.sim.pwm_mode = "8-bit";
  if (chance(0.1)) s.gate.brake_duty_max = 0.5 + 0.5 * uniform(generator);
  if (chance(0.1)) s.gate.brake_rate_per_s = 1.0 + 100.0 * uniform(generator);
  if (chance(0.05)) s.experiment.brake_limit_s = 0.2 + 2.0 * uniform(generator);
  if (chance(0.1)) s.gate.overspeed_rad_s = 150.0;
  if (chance(0.1)) s.experiment.hold_torque_Nm = 5.0 * uniform(generator);
  s.plant.rig.encoder_counts_per_rev = s.model.encoder_counts_per_rev;

  const Variation wide{.wheels = 0.3, .brake = 0.2, .tyre = 0.2, .theta = 0.3, .radii = 0.02, .phase = true};
  c.job.plant = perturbed(s.plant, draw(chance(0.5) ? wide : Variation::standard(), generator(), 0));
  c.job.seed = generator();
  if (chance(0.3)) draw_conditions(generator, c.job.plant);
  if (chance(0.2)) c.job.plant.ideal_sensors = s.plant.ideal_sensors = true;
  if (chance(0.2)) c.job.plant.ideal_actuator = s.plant.ideal_actuator = true;
  if (chance(0.02)) s.plant.ideal_actuator = !s.plant.ideal_actuator;
  if (chance(0.05)) c.job.plant.rig.brake.brake_rate_limit_Nm_s = 50.0 + 200.0 * uniform(generator);
  if (chance(0.05))
    c.job.plant.brake_flaws = {.hysteresis = 0.1, .fading_per_J = 3e-4, .overshoot = 0.5, .ripple_Nm = 1.0};
  if (chance(0.05)) c.job.plant.rig.brake.brake_dead_time_s = 0.003;
  if (chance(0.05)) s.model.brake.brake_dead_time_s = 0.005;
  if (chance(0.05)) c.job.plant.rig.upper_encoder = {.eccentricity_rad = 0.01, .phase_rad = 1.0};
  if (chance(0.05)) s.model.lower_encoder = {.eccentricity_rad = 0.005, .phase_rad = -1.0};
  if (chance(0.05)) c.job.plant.lower_encoder_flaws = {.slot_error_counts = 0.3, .lost_counts = 2};
  if (chance(0.1)) c.job.plant.max_step_s = 50e-6 + 900e-6 * uniform(generator);
  return c;
}

std::vector<Outcome> batch(const std::vector<Case>& cases, std::size_t threads, BatchCounts& counts,
                           bool reversed = false) {
  std::vector<Outcome> outcomes(cases.size());
  const auto place = [&](std::size_t i) { return reversed ? cases.size() - 1 - i : i; };
  counts = run_batch(
      cases.size(), threads,
      [&](std::size_t i) {
        Job job = cases[place(i)].job;
        job.settings = &cases[place(i)].settings;
        return job;
      },
      [&](std::size_t i, Outcome outcome) { outcomes[place(i)] = std::move(outcome); });
  return outcomes;
}

/// Computes the cases alone and in the lanes of each set: most of them are complete there, `scalar` have none.
void require_bits_of_simulate(const std::vector<Case>& cases, std::size_t scalar) {
  BatchCounts none;
  const std::vector<Outcome> alone = [&] {
    const Lanes lanes("none");
    return batch(cases, 2, none);
  }();
  for (const char* set : sets()) {
    const Lanes lanes(set);
    BatchCounts counts;
    const std::vector<Outcome> outcomes = batch(cases, 2, counts);
    INFO(set << ": " << counts.lanes << " in lanes, " << counts.disturbed << " disturbed, " << counts.scalar
             << " scalar");
    CHECK(counts.lanes > cases.size() / 2);
    CHECK(counts.scalar == scalar);
    for (std::size_t i = 0; i < cases.size(); ++i) {
      INFO(i << ", seed " << cases[i].job.seed);
      REQUIRE(outcomes[i].refusal == alone[i].refusal);
      REQUIRE(same_bits(outcomes[i].run, alone[i].run));
    }
  }
}

}  // namespace

TEST_CASE("every run of a batch has the bits of simulate, whatever runs beside it") {
  const std::vector<config::Settings> plants{settings_of("paper-table1"), settings_of("paper-timing"),
                                             settings_of("inteco-manual")};
  std::mt19937_64 generator(20261122);
  std::vector<Case> cases;
  for (int i = 0; i < 3000; ++i) cases.push_back(drawn_case(generator, plants));

  BatchCounts none;
  const std::vector<Outcome> alone = [&] {
    const Lanes lanes("none");
    return batch(cases, 2, none);
  }();
  CHECK(none.scalar == cases.size());
  std::size_t stopped = 0;
  std::size_t faults = 0;
  for (const Outcome& outcome : alone) {
    CHECK(outcome.refusal.empty());
    (outcome.run.stopped() ? stopped : faults) += 1;
  }
  // Both kinds of end are tried.
  CHECK(stopped > cases.size() / 2);
  CHECK(faults > 20);

  for (const char* set : sets()) {
    const Lanes lanes(set);
    BatchCounts counts;
    const std::vector<Outcome> outcomes = batch(cases, 2, counts, std::string(set) != "portable");
    INFO(set << ": " << counts.lanes << " in lanes, " << counts.disturbed << " disturbed, " << counts.scalar
             << " scalar");
    CHECK(counts.lanes + counts.disturbed + counts.scalar == cases.size());
    CHECK(counts.lanes > 500);
    CHECK(counts.disturbed > 10);
    for (std::size_t i = 0; i < cases.size(); ++i) {
      INFO(i << " " << cases[i].settings.control.controller);
      REQUIRE(outcomes[i].refusal == alone[i].refusal);
      REQUIRE(same_bits(outcomes[i].run, alone[i].run));
    }
  }
}

TEST_CASE("every law but a user's has lanes, on every plant, road and drift") {
  REQUIRE(registered);
  std::mt19937_64 generator(23);
  for (const control::ControllerEntry& entry : control::controllers()) {
    const bool scalar = entry.name == own_name;
    for (const char* plant : {"paper-table1", "inteco-manual"}) {
      Case c{settings_of(plant), {}};
      c.settings.control.controller = entry.name;
      c.settings.experiment.start_speed_rad_s = 150.0;
      std::vector<Case> cases(20, c);
      for (Case& one : cases) {
        one.job.plant = one.settings.plant;
        draw_conditions(generator, one.job.plant);
        one.job.plant.ideal_actuator = one.settings.plant.ideal_actuator = generator() % 4 == 0;
        one.job.plant.ideal_sensors = generator() % 4 == 0;
        one.job.seed = generator();
      }
      BatchCounts none;
      const std::vector<Outcome> alone = [&] {
        const Lanes lanes("none");
        return batch(cases, 2, none);
      }();
      BatchCounts counts;
      const std::vector<Outcome> outcomes = batch(cases, 2, counts);
      INFO(entry.name << " on " << plant << ": " << counts.lanes << " in lanes, " << counts.disturbed << " disturbed");
      CHECK(counts.scalar == (scalar ? cases.size() : 0));
      for (std::size_t i = 0; i < cases.size(); ++i) {
        INFO(cases[i].job.plant.friction_profile);
        REQUIRE(outcomes[i].refusal == alone[i].refusal);
        REQUIRE(same_bits(outcomes[i].run, alone[i].run));
      }
    }
  }
}

TEST_CASE("adaptive-peak has the bits of simulate with any gains, rates and jumps of friction") {
  // Its samples lie in rings, in which each lane has a place of its own.
  const std::vector<config::Settings> plants{settings_of("paper-table1"), settings_of("inteco-manual")};
  std::mt19937_64 generator(20261123);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::vector<Case> cases;
  for (int i = 0; i < 2000; ++i) {
    Case c{plants[generator() % plants.size()], {}};
    c.settings.control.controller = "adaptive-peak";
    auto& o = c.settings.control.adaptive_peak;
    for (double* value :
         {&o.ks0, &o.ks1, &o.lag_gain_per_s, &o.slip_rate_per_s, &o.search_rad_s, &o.peak.peak_force0_N,
          &o.peak.force_drift_per_s, &o.peak.slip_drift_per_s, &o.peak.shape_drift_per_s, &o.peak.force_noise_N2_s,
          &o.peak.jump_level, &o.peak.jump_hold_s, &o.observer.force_rate_N2_s})
      scale(generator, *value, 3.0);
    o.search_part *= 2.0 * uniform(generator);
    o.peak.peak_slip0 = o.slip_min + (o.slip_max - o.slip_min) * uniform(generator);
    // Few rates, so that there are packs in which the runs have jumps at different times.
    constexpr double rates_Hz[]{500.0, 1000.0, 1490.0, 2000.0};
    c.settings.control.rate_Hz = rates_Hz[generator() % std::size(rates_Hz)];
    c.settings.experiment.start_speed_rad_s = 60.0 + 140.0 * uniform(generator);
    c.job.plant = perturbed(c.settings.plant, draw(Variation::standard(), generator(), 0));
    c.job.seed = generator();
    draw_conditions(generator, c.job.plant);
    cases.push_back(std::move(c));
  }
  require_bits_of_simulate(cases, 0);
}

TEST_CASE("adaptive-optimal has the bits of simulate with any gains, encoders, rates and jumps of friction") {
  const std::vector<config::Settings> plants{settings_of("paper-table1"), settings_of("inteco-manual")};
  std::mt19937_64 generator(20261126);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::vector<Case> cases;
  for (int i = 0; i < 1200; ++i) {
    Case c{plants[generator() % plants.size()], {}};
    config::Settings& s = c.settings;
    s.control.controller = "adaptive-optimal";
    auto& o = s.control.adaptive_optimal;
    auto& b = o.bank;
    for (double* value :
         {&o.slip_gain_per_s, &o.slip_gain_runaway, &o.torque_gain_per_s, &o.play_Nm, &o.bold_slip, &o.runaway,
          &o.model_error_per_s, &o.search_rad_s, &o.slip_rate_per_s, &o.observer.force_rate_N2_s})
      scale(generator, *value, 2.5);
    for (double* value : {&b.force_noise_N2_s, &b.timing_error_s, &b.start_s, &b.slip0, &b.level0_N, &b.share_per_s,
                          &b.past_peak_cost, &b.jump_share, &b.jump_hold_s, &b.jump_spread, &b.jump_after_s})
      scale(generator, *value, 2.5);
    o.search_part *= 2.0 * uniform(generator);
    if (generator() % 2 == 0) b.last_peak_slip = 0.02 + 0.23 * uniform(generator);
    // Few rates, so that there are packs in which the runs have jumps at different times.
    constexpr double rates_Hz[]{500.0, 1000.0, 1490.0};
    s.control.rate_Hz = rates_Hz[generator() % std::size(rates_Hz)];
    s.plant.rig.encoder_counts_per_rev = s.model.encoder_counts_per_rev = 1024 << (generator() % 3);
    s.experiment.start_speed_rad_s = 60.0 + 140.0 * uniform(generator);
    c.job.plant = perturbed(s.plant, draw(Variation::standard(), generator(), 0));
    c.job.plant.ideal_actuator = s.plant.ideal_actuator = generator() % 8 == 0;
    c.job.plant.ideal_sensors = generator() % 8 == 0;
    c.job.seed = generator();
    draw_conditions(generator, c.job.plant);
    cases.push_back(std::move(c));
  }
  // Twice as fast, the law learns in every second cycle, and has no lanes.
  for (int i = 0; i < 10; ++i) cases[static_cast<std::size_t>(i)].settings.control.rate_Hz = 2000.0;
  require_bits_of_simulate(cases, 10);
}

TEST_CASE("what becomes of a run does not depend on threads, order and number of runs") {
  const config::Settings plant = settings_of("paper-table1");
  std::vector<Case> cases(300, Case{plant, {}});
  for (std::size_t i = 0; i < cases.size(); ++i) {
    cases[i].settings.experiment.start_speed_rad_s = 60.0;
    const Perturbation perturbation = draw(Variation::standard(), 9, i);
    cases[i].job = {.plant = perturbed(plant.plant, perturbation), .seed = perturbation.sensor_seed};
  }
  BatchCounts counts;
  const std::vector<Outcome> one = batch(cases, 1, counts);
  CHECK(counts.lanes + counts.disturbed == cases.size());
  const std::vector<Outcome> two = batch(cases, 2, counts, true);
  const std::vector<Case> few(cases.begin(), cases.begin() + 3);
  const std::vector<Outcome> three = batch(few, 1, counts);
  for (std::size_t i = 0; i < cases.size(); ++i) CHECK(same_bits(one[i].run, two[i].run));
  for (std::size_t i = 0; i < few.size(); ++i) CHECK(same_bits(one[i].run, three[i].run));
}

TEST_CASE("jobs that cannot run are refused one by one") {
  config::Settings plant = settings_of("paper-table1");
  std::vector<Case> cases(3, Case{plant, {}});
  for (Case& c : cases) {
    c.settings.experiment.start_speed_rad_s = 60.0;
    c.job.plant = plant.plant;
  }
  cases[1].job.plant.rig.wheels.J1_kg_m2 = -1.0;
  BatchCounts counts;
  const std::vector<Outcome> outcomes = batch(cases, 1, counts);
  CHECK(outcomes[0].refusal.empty());
  CHECK_THAT(outcomes[1].refusal, Catch::Matchers::Contains("J1"));
  CHECK(outcomes[2].refusal.empty());
  CHECK(same_bits(outcomes[0].run, outcomes[2].run));
}

TEST_CASE("an unknown choice of lanes is refused by name") {
  const Lanes lanes("sse9");
  CHECK_THROWS_WITH(lanes::instruction_set(),
                    Catch::Matchers::Contains("ABS_HIL_LANES=sse9") && Catch::Matchers::Contains("portable"));
}
