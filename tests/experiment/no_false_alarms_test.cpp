// Runs without faults: the gate's plausibility checks must find nothing in any of them.

#include <filesystem>

#include "abs_hil/control/registry.hpp"
#include "catch.hpp"
#include "config/config_file.hpp"
#include "config/events.hpp"
#include "config/key_table.hpp"
#include "config/library.hpp"
#include "config/plan.hpp"
#include "injected_run.hpp"
#include "simulated_run.hpp"
#include "study/simulated_run.hpp"
#include "study/variation.hpp"

using namespace abs_hil;
using namespace abs_hil::experiment;

namespace {

config::Settings configured(const std::string& plant, const std::string& experiment, std::string_view controller,
                            double rate_Hz) {
  config::Settings s;
  config::KeyTable keys(s);
  config::load_file(config::plant_file(plant), keys, config::Tables::of_plant);
  s.plant.friction_profile = config::profile(*config::find(experiment), "friction");
  s.experiment.name = experiment;
  s.control.controller = controller;
  s.control.rate_Hz = rate_Hz;
  return s;
}

rig::Reason end_of(const config::Settings& s) {
  const test::Setup setup{s.plant, s.control, s.experiment, s.gate, static_cast<std::uint64_t>(s.seed)};
  return test::run(setup).outcome.reason;
}

const std::vector<std::string> plants{"paper-table1", "paper-timing", "inteco-manual"};

}  // namespace

TEST_CASE("no controller on any plant at any rate trips a check") {
  int runs = 0;
  for (const std::string experiment : {"paper", "friction-jump"}) {
    for (const std::string& plant : plants) {
      for (const auto& controller : control::controllers()) {
        for (const double rate_Hz : {500.0, 1000.0, 5000.0}) {
          CAPTURE(experiment, plant, controller.name, rate_Hz);
          CHECK(end_of(configured(plant, experiment, controller.name, rate_Hz)) == rig::Reason::sequence_complete);
          ++runs;
        }
      }
    }
  }
  CHECK(runs >= 2 * 3 * 6 * 3);
}

TEST_CASE("the other experiments trip no check") {
  for (const auto& known : config::known_experiments()) {
    if (known->series.of_experiments) continue;  // it only names others
    for (const std::string& plant : plants) {
      CAPTURE(known->name, plant);
      CHECK(end_of(configured(plant, known->name, "adaptive", 1000.0)) == rig::Reason::sequence_complete);
    }
  }
}

TEST_CASE("ideal sensors and actuators, other seeds and other encoders trip no check") {
  for (const auto& controller : control::controllers()) {
    CAPTURE(controller.name);
    config::Settings s = configured("paper-table1", "paper", controller.name, 1000.0);
    s.experiment.start_speed_rad_s = 170.0;
    s.plant.ideal_sensors = true;
    CHECK(end_of(s) == rig::Reason::sequence_complete);
    s.plant.ideal_actuator = true;
    CHECK(end_of(s) == rig::Reason::sequence_complete);
    s.plant.ideal_sensors = false;
    CHECK(end_of(s) == rig::Reason::sequence_complete);
    s.plant.ideal_actuator = false;
    for (const std::int32_t counts_per_rev : {512, 20'000}) {
      s.plant.rig.encoder_counts_per_rev = counts_per_rev;
      CHECK(end_of(s) == rig::Reason::sequence_complete);
    }
    s.plant.rig.encoder_counts_per_rev = 4096;
    for (s.seed = 2; s.seed < 6; ++s.seed) CHECK(end_of(s) == rig::Reason::sequence_complete);
  }
}

TEST_CASE("reads that take most of a period trip no check") {
  for (const std::string& plant : plants) {
    for (const auto& controller : control::controllers()) {
      for (const double rate_Hz : {100.0, 250.0, 1000.0, 10'000.0}) {
        for (const double share : {0.4, 0.55, 0.7, 0.95}) {
          CAPTURE(plant, controller.name, rate_Hz, share);
          config::Settings s = configured(plant, "paper", controller.name, rate_Hz);
          s.experiment.start_speed_rad_s = 170.0;
          const test::Setup setup{s.plant, s.control, s.experiment, s.gate};
          CHECK(test::run_injected(setup, {test::slow_reads(share, rate_Hz)}).outcome.reason ==
                rig::Reason::sequence_complete);
        }
      }
    }
  }
}

TEST_CASE("plants that differ by 20 % from the gate's parameters trip no check, from rest to standstill") {
  const auto variation = study::Variation::parse("parameters=0.2,theta=0.2,phase");
  for (const std::string& plant : plants) {
    for (const char* controller : {"adaptive", "relay", "locked", "sliding-mode"}) {
      const config::Settings nominal = configured(plant, "paper", controller, 1000.0);
      for (std::uint64_t index = 0; index < 5; ++index) {
        CAPTURE(plant, controller, index);
        const study::Perturbation drawn = study::draw(variation, 7, index);
        runtime::VirtualClock clock;
        driver::SimDriver driver(study::perturbed(nominal.plant, drawn), {.seed = drawn.sensor_seed});
        RunSession session(clock, driver,
                           make_logic_parts(nominal.control, nominal.plant.rig, false, nominal.gate, nominal.experiment,
                                            config::plan(nominal).phases),
                           nominal.gate, {});
        CHECK(session.run_fast([] { return rig::Reason::none; }).reason == rig::Reason::sequence_complete);
      }
    }
  }
}
