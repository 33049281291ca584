// `abs_hil export-fmu`: the simulated rig or a slip controller as an FMU.
#include <fmt/format.h>

#include <memory>

#include "abs_hil/control/registry.hpp"
#include "config/config_error.hpp"
#include "interchange/export.hpp"
#include "interchange/fmu/controller_model.hpp"
#include "interchange/fmu/plant_model.hpp"
#include "program/exit_status.hpp"
#include "program/run_arguments.hpp"
#include "program/subcommands.hpp"

namespace abs_hil::program {

namespace {

void fill(interchange::fmu::PlantModel& model, const config::Settings& s) {
  model.options = s.plant;
  model.experiment = s.experiment;
  model.board = s.driver.sim;
  model.begin.seed = static_cast<std::int32_t>(s.seed);
}

void fill(interchange::fmu::ControllerModel& model, const config::Settings& s) {
  model.control = s.control;
  model.model = s.model;
  model.experiment = s.experiment;
  model.board = s.driver.sim;
  model.sensors.ideal_actuator = s.plant.ideal_actuator;
  model.sensors.speeds_given = s.plant.ideal_sensors;
}

struct ExportOptions {
  RunOptions options{};
  int fmi{2};
  std::string out{};
};

int export_fmu(const ExportOptions& command) {
  if (command.fmi != 2 && command.fmi != 3) {
    throw config::ConfigError(fmt::format("export-fmu: --fmi {}: give 2 or 3", command.fmi));
  }
  const config::Settings s = merged_settings(command.options);
  if (s.seed > 2'147'483'647) throw config::ConfigError("export-fmu: run.seed: an FMU takes at most 2147483647");
  interchange::FmuExport what{.version = ABS_HIL_VERSION,
                              .fmi = command.fmi,
                              .step_s = 1.0 / s.control.rate_Hz,
                              .binaries = interchange::fmu_binaries()};
  interchange::fmu::PlantModel plant;
  interchange::fmu::ControllerModel controller;
  const bool law = command.options.controller.has_value();
  if (law && control::is_controller_file(s.control.controller)) {
    throw config::ConfigError(fmt::format(
        "export-fmu: --controller {}: only controllers of this program can be exported", s.control.controller));
  }
  if (law) {
    what.kind = interchange::fmu::controller_kind;
    what.name = "abs_hil controller " + s.control.controller;
    fill(controller, s);
    controller.start(0.0);  // refuses what cannot work
  } else {
    what.kind = interchange::fmu::plant_kind;
    what.name = "abs_hil plant " + s.plant_name;
    fill(plant, s);
    plant.start(0.0);
  }
  const interchange::fmu::Model& model = law ? static_cast<const interchange::fmu::Model&>(controller) : plant;
  try {
    const std::string platforms = interchange::write_fmu(what, model, command.out);
    fmt::print("{}: FMI {}.0 co-simulation, {} variables, step {} s, for {}\n", what.name, what.fmi,
               model.variables().size(), what.step_s, platforms);
  } catch (const std::runtime_error& error) {
    throw config::ConfigError(std::string("export-fmu: ") + error.what());
  }
  return exit_completed;
}

}  // namespace

Action add_export_fmu(cli::Parser& parser, const Words&) {
  const auto o = std::make_shared<ExportOptions>();
  add_configuration_options(parser, o->options);
  parser.add({.names = "--fmi", .to = &o->fmi, .help = "version of FMI, 2 or 3", .show_default = true});
  parser.add({.names = "--out", .to = &o->out, .help = "file to write", .type = "FILE.fmu", .required = true});
  return [o] { return export_fmu(*o); };
}

}  // namespace abs_hil::program
