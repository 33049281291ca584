#include "program/run_parts.hpp"

#include <spdlog/spdlog.h>

#include <utility>

#include "driver/factory.hpp"
#include "driver/injection/injecting_driver.hpp"
#include "driver/injection/injection.hpp"
#include "driver/sim/sim_driver.hpp"

namespace abs_hil::program {

std::unique_ptr<driver::RigDriver> make_driver(const config::Settings& s, bool fast) {
  if (s.backend == "rig") return driver::make_rig_driver(s.driver, fast);
  return std::make_unique<driver::SimDriver>(
      s.plant, driver::SimStart{.seed = config::sensor_seed(s),
                                .start_speed_rad_s = s.experiment.start_speed_rad_s,
                                .pwm_mode = driver::pwm_mode_named(s.driver.sim.pwm_mode)});
}

std::unique_ptr<driver::RigDriver> with_faults(std::unique_ptr<driver::RigDriver> driver, const config::Settings& s,
                                               runtime::Clock& clock) {
  std::vector<driver::Injection> injections = driver::parse_injections(s.inject);
  if (injections.empty()) return driver;
  for (const driver::Injection& injection : injections) spdlog::warn("fault injected: {}", driver::to_text(injection));
  return std::make_unique<driver::InjectingDriver>(
      std::move(driver), std::move(injections), static_cast<std::uint64_t>(s.seed),
      [&clock](std::int64_t duration_ns) { clock.sleep_until(clock.now_ns() + duration_ns); });
}

experiment::RunLogicParts make_logic(const config::Settings& s, std::vector<experiment::PhasePlan> plans,
                                     const experiment::SequenceLimits& limits) {
  experiment::RunLogicParts parts = experiment::make_logic_parts(
      s.control, s.model, config::identity(s), s.plant.ideal_actuator, s.gate, s.experiment, std::move(plans), limits);
  parts.recorded_r2_m = s.plant.rig.wheels.r2_m;
  parts.duty_steps = config::output_grid(s).duty_steps;
  return parts;
}

}  // namespace abs_hil::program
