// What there is to choose from: controllers, plants, experiments, configuration keys,
// figures of merit.

#include <pybind11/stl.h>

#include <set>
#include <string>

#include "abs_hil/control/registry.hpp"
#include "abs_hil/rig/brake_map.hpp"
#include "analysis/braking_figures.hpp"
#include "bindings.hpp"
#include "config/config_file.hpp"
#include "config/key_table.hpp"
#include "config/script.hpp"

namespace abs_hil::python {

namespace {

py::dict controllers() {
  py::dict all;
  for (const control::ControllerEntry& entry : control::controllers()) {
    if (entry.name != python_controller)
      all[py::str(entry.name.data(), entry.name.size())] = std::string(entry.summary);
  }
  return all;
}

py::dict plants() {
  py::dict all;
  for (const config::PlantEntry& plant : config::known_plants()) all[py::str(plant.name)] = plant.description;
  return all;
}

py::dict experiments() {
  py::dict all;
  for (const auto& script : config::known_experiments()) all[py::str(script->name)] = script->description;
  return all;
}

py::object python_value(const config::Key& key) {
  return std::visit([](const auto* target) { return py::cast(*target); }, key.target);
}

/// One dictionary for each key, with the values that these options give.
py::list keys(const py::dict& arguments) {
  config::Configuration request = config::merge(run_options(arguments));
  const config::KeyTable table(request.settings);
  py::list all;
  for (const config::Key& key : table.keys()) {
    py::dict row;
    row["name"] = key.name;
    row["unit"] = std::string(key.unit);
    row["meaning"] = std::string(key.meaning);
    row["value"] = python_value(key);
    if (key.search.given()) {
      row["search"] = py::make_tuple(key.search.least, key.search.most, key.search.logarithmic);
    }
    all.append(row);
  }
  return all;
}

/// One dictionary for each figure of merit, in the order of a study's results.
py::list figures() {
  py::list all;
  for (const analysis::Figure& figure : analysis::figures) {
    py::dict row;
    row["name"] = std::string(figure.name);
    row["title"] = std::string(figure.title);
    row["unit"] = std::string(figure.unit);
    row["decimals"] = figure.decimals;
    row["better"] = std::string(analysis::name_of(figure.better));
    row["compared"] = figure.compared;
    row["in_summary"] = figure.summary_place > 0;
    row["meaning"] = std::string(figure.meaning);
    all.append(row);
  }
  return all;
}

double max_brake_torque_Nm(const py::dict& arguments) {
  const config::Settings s = config::merge(run_options(arguments)).settings;
  return rig::brake_torque_at(s.plant.rig.brake, s.gate.brake_duty_max);
}

/// From now on controllers may come from files with this ending. @param maker  of abs_hil._network
void take_controller_files(const std::string& ending, const py::capsule& maker) {
  static std::set<std::string> endings;
  control::register_controller_files(
      {*endings.insert(ending).first,
       reinterpret_cast<decltype(control::ControllerFiles::make)>(maker.get_pointer<void>())});
}

}  // namespace

void add_tables(py::module_& module) {
  module.def("controllers", &controllers, "Name -> description of every controller of the program.");
  module.def("take_controller_files", &take_controller_files, py::arg("ending"), py::arg("maker"));
  module.def("plants", &plants, "Name -> description of every plant.");
  module.def("experiments", &experiments, "Name -> description of every experiment.");
  module.def("figures", &figures);
  module.def("keys", &keys, py::arg("options"));
  module.def("section_of", [](const std::string& controller) { return control::section_of(controller); });
  module.def("max_brake_torque_Nm", &max_brake_torque_Nm, py::arg("options"));
}

}  // namespace abs_hil::python
