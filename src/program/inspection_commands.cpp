#include "program/inspection_commands.hpp"

#include "diagnosis/doctor.hpp"
#include "program/run_arguments.hpp"

namespace abs_hil::program {

void add_list(cli::Parser& parser, ListCommand& command) {
  command.parser = parser.add_subcommand("list", "list controllers, plants, experiments and backends");
  command.parser.add({.names = "--keys",
                      .to = &command.keys,
                      .help = "list all configuration values with unit, range and safety class"});
  command.parser.add({.names = "--quantities",
                      .to = &command.quantities,
                      .help = "list the quantities of a CSV row and of ABS_TELEMETRY",
                      .excludes = {"--keys"}});
  command.parser.add({.names = "--reasons",
                      .to = &command.reasons,
                      .help = "list the reasons of phase changes, ends of runs and refused commands",
                      .excludes = {"--keys", "--quantities"}});
  command.parser.add({.names = "--json", .to = &command.json, .help = "print keys, quantities or reasons as JSON"});
}

void add_doctor(cli::Parser& parser, DoctorCommand& command) {
  command.parser = parser.add_subcommand("doctor", "check this computer and give a fix for each shortcoming");
  add_backend_option(command.parser, command.options);
  add_configuration_options(command.parser, command.options);
  command.parser.add(
      {.names = "--only", .to = &command.only, .help = "run only this check", .one_of = diagnosis::check_names()});
  command.parser.add({.names = "--json", .to = &command.json, .help = "print JSON instead of text"});
}

void add_latency(cli::Parser& parser, LatencyCommand& command) {
  command.parser =
      parser.add_subcommand("latency", "run the real-time cycle on the simulated rig and judge this computer's timing");
  add_configuration_options(command.parser, command.options);
  add_timing_options(command.parser, command.options);
  command.parser.add({.names = "--duration",
                      .to = &command.latency.duration_s,
                      .help = "duration of the test, s",
                      .type = "S",
                      .show_default = true});
  command.parser.add({.names = "--secaligned",
                      .to = &command.latency.second_offset_us,
                      .help = "begin at a whole second plus this many us, like cyclictest's option of the same name",
                      .type = "US",
                      .range = {0, 999'999}});
  command.parser.add({.names = "--json", .to = &command.latency.json, .help = "print JSON instead of text"});
}

void add_validate(cli::Parser& parser, ValidateCommand& command) {
  command.parser = parser.add_subcommand("validate", "describe an experiment and check it against the limits");
  command.parser.add({.names = "EXPERIMENT",
                      .to = &command.options.experiment,
                      .help = "experiment by name or TOML file",
                      .type = "NAME|FILE"});
  command.parser.add(
      {.names = "--schema", .to = &command.schema, .help = "print the JSON Schema of experiment files instead"});
  add_backend_option(command.parser, command.options);
  add_configuration_options(command.parser, command.options);
}

void add_init_rig(cli::Parser& parser, InitRigCommand& command) {
  command.parser = parser.add_subcommand("init-rig", "write NAME.toml, the parameters of a rig of your own to fill in");
  command.parser.add(
      {.names = "name", .to = &command.name, .help = "name of the rig", .type = "NAME", .required = true});
  command.parser.add({.names = "--plant",
                      .to = &command.options.plant,
                      .help = "plant whose values it begins with, by name or TOML file",
                      .type = "NAME|FILE"});
}

}  // namespace abs_hil::program
