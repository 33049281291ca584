#include "run_parts.hpp"

#include <utility>

#include "abs_hil/control/registry.hpp"
#include "abs_hil/driver/factory.hpp"
#include "abs_hil/driver/sim/sim_driver.hpp"

namespace abs_hil::app {

std::unique_ptr<driver::RigDriver> make_driver(const settings::Settings& s, bool fast) {
  if (s.backend == "rig") return driver::make_rig_driver(s.driver, fast);
  return std::make_unique<driver::SimDriver>(s.plant,
                                             driver::SimStart{.seed = static_cast<std::uint64_t>(s.seed),
                                                              .start_speed_rad_s = s.experiment.start_speed_rad_s});
}

experiment::RunLogicParts make_logic(const settings::Settings& s, std::vector<experiment::PhasePlan> plans) {
  return {.control = s.control,
          .rig = s.plant.rig,
          .controller = control::make_controller(s.control.controller, {s.control, s.plant.rig}),
          .sequence = experiment::Sequence(std::move(plans)),
          .ideal_actuator = s.plant.ideal_actuator,
          .max_brake_duty = s.gate.brake_duty_max,
          .start_speed_rad_s = s.experiment.start_speed_rad_s};
}

}  // namespace abs_hil::app
