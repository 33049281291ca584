// What an FMU of the simulated rig or of a slip controller describes: its variables with their facts and start values.

#include <fmt/format.h>
#include <pybind11/stl.h>

#include <array>
#include <stdexcept>
#include <string>

#include "abs_hil/control/registry.hpp"
#include "bindings.hpp"
#include "interchange/fmu/models.hpp"

namespace abs_hil::python {

namespace {

using namespace interchange;

void fill(fmu::PlantModel& model, const config::Settings& s) {
  model.options = s.plant;
  model.experiment = s.experiment;
  model.board = s.driver.sim;
  model.begin.seed = static_cast<std::int32_t>(s.seed);
}

void fill(fmu::ControllerModel& model, const config::Settings& s) {
  model.control = s.control;
  model.model = s.model;
  model.experiment = s.experiment;
  model.board = s.driver.sim;
  model.sensors.ideal_actuator = s.plant.ideal_actuator;
  model.sensors.speeds_given = s.plant.ideal_sensors;
}

py::dict described(const fmu::Variable& variable, bool tunable) {
  constexpr std::array types{"real", "integer", "", "boolean", "string"};  // of rig::OptionTarget
  constexpr std::array causalities{"parameter", "input", "output"};
  py::dict row;
  row["name"] = variable.name;
  row["type"] = types.at(variable.value.index());
  row["causality"] = causalities.at(static_cast<std::size_t>(variable.causality));
  row["tunable"] = tunable;
  row["unit"] = std::string(variable.facts.unit);
  row["meaning"] = std::string(variable.facts.meaning);
  row["allowed"] = variable.facts.allowed.list();
  row["least"] = variable.facts.range.least;
  row["most"] = variable.facts.range.most;
  row["start"] = fmu::text_of(variable);
  return row;
}

template <class Model>
py::dict model_of(const config::Settings& s, std::string_view kind, const std::string& name) {
  Model model;
  fill(model, s);
  model.start(0.0);  // refuses what cannot work
  py::list variables;
  for (const fmu::Variable& variable : model.variables()) {
    variables.append(described(variable, model.tunable(variable)));
  }
  py::dict facts;
  facts["name"] = fmt::format("abs_hil {} {}", kind, name);
  facts["token"] = fmu::token_of(kind, model);
  facts["varied_step"] = kind == fmu::plant_kind;
  facts["step_s"] = 1.0 / s.control.rate_Hz;
  facts["variables"] = variables;
  return facts;
}

/// The controller that the options name, else the rig.
py::dict fmu_model(const py::dict& options) {
  const config::Settings s = config::merged_settings(run_options(options));
  if (s.seed > 2'147'483'647) throw std::invalid_argument("run.seed: an FMU takes at most 2147483647");
  if (!options.contains("controller")) return model_of<fmu::PlantModel>(s, fmu::plant_kind, s.plant_name);
  if (control::is_controller_file(s.control.controller)) {
    throw std::invalid_argument("--controller " + s.control.controller +
                                ": only controllers of this program can be exported");
  }
  return model_of<fmu::ControllerModel>(s, fmu::controller_kind, s.control.controller);
}

}  // namespace

void add_fmus(py::module_& module) { module.def("fmu_model", &fmu_model, py::arg("options")); }

}  // namespace abs_hil::python
