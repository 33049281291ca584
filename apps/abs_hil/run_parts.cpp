#include "run_parts.hpp"

#include <utility>

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
  return experiment::make_logic_parts(s.control, s.plant.rig, s.plant.ideal_actuator, s.gate, s.experiment,
                                      std::move(plans));
}

}  // namespace abs_hil::app
