#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <exception>
#include <stdexcept>

#include "abs_hil/driver/io_result.hpp"
#include "abs_hil/settings/config_error.hpp"
#include "abs_hil/telemetry/file_error.hpp"
#include "abs_hil/telemetry/lcm_outlet.hpp"
#include "commands.hpp"
#include "exit_status.hpp"

namespace {

using namespace abs_hil;

void add_run_options(CLI::App& cli, app::RunOptions& o) {
  cli.add_option("--backend", o.backend, "sim or rig")->check(CLI::IsMember({"sim", "rig"}))->capture_default_str();
  cli.add_option("--config", o.config_file, "TOML file with any configuration values")->type_name("FILE");
  cli.add_option("--plant", o.plant, "plant by name or TOML file")->type_name("NAME|FILE");
  cli.add_option("--controller", o.controller, "slip controller")->type_name("NAME");
  cli.add_option("--experiment", o.experiment, "experiment")->type_name("NAME");
  cli.add_option("--slip-ref", o.slip_ref, "wanted slip, in (0, 1)")->type_name("X");
  cli.add_option("--rate", o.rate_Hz, "control cycles per second, 100 to 10000")->type_name("HZ");
  cli.add_flag("--fast", o.outputs.fast, "virtual time, as fast as the machine can");
  cli.add_option("--seed", o.seed, "seed of everything random in the simulator")->type_name("N");
  cli.add_option("--set", o.assignments, "set any configuration value (abs_hil list --keys)")
      ->type_name("key=value")
      ->take_all()
      ->allow_extra_args(false);
  cli.add_option("--csv", o.outputs.csv_file, "write every cycle to a CSV file")->type_name("FILE");
  cli.add_option("--log", o.outputs.log_file, "write an LCM event log (.lcmlog)")->type_name("FILE");
  cli.add_option("--summary", o.outputs.summary_file, "write the summary as JSON")->type_name("FILE");
  auto* url =
      cli.add_option("--lcm-url", o.outputs.lcm_url, "LCM network (default: LCM_DEFAULT_URL, else UDP multicast)");
  cli.add_flag("--no-lcm", o.outputs.no_lcm, "do not publish")->excludes(url);
  cli.add_option("--rt", o.realtime, "real-time scheduling")
      ->check(CLI::IsMember({"require", "prefer", "off"}))
      ->capture_default_str();
}

int dispatch(int argc, char** argv) {
  CLI::App cli{"Driver, adaptive slip controller and simulator of the Inteco ABS laboratory rig"};
  cli.name("abs_hil");
  cli.set_version_flag("--version", ABS_HIL_VERSION);
  app::RunOptions options;
  add_run_options(cli, options);
  cli.require_subcommand(0, 1);
  auto* list = cli.add_subcommand("list", "controllers, plants, experiments, backends");
  bool keys = false;
  list->add_flag("--keys", keys, "all configuration values with unit and range");
  auto* doctor = cli.add_subcommand("doctor", "what this machine can do, each shortcoming with its fix");
  std::string only;
  doctor->add_option("--only", only, "one check alone")->check(CLI::IsMember(app::doctor_checks()));
  try {
    cli.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return cli.exit(error);  // --help, --version
    fprintf(stderr, "abs_hil: %s (abs_hil --help shows all options)\n", error.what());
    return app::exit_usage;
  }
  if (list->parsed()) return app::list(keys);
  if (doctor->parsed()) return app::doctor(only);
  return app::run(app::merge(options));
}

int fail(int status, const std::exception& error) {
  fprintf(stderr, "abs_hil: %s\n", error.what());
  return status;
}

}  // namespace

int main(int argc, char** argv) {
  // Messages go to stderr; stdout is for results.
  spdlog::set_default_logger(spdlog::stderr_color_mt("abs_hil"));
  spdlog::set_pattern("%n: %^%l%$: %v");
  try {
    return dispatch(argc, argv);
  } catch (const settings::ConfigError& error) {
    return fail(app::exit_usage, error);
  } catch (const std::invalid_argument& error) {
    return fail(app::exit_usage, error);
  } catch (const driver::Unavailable& error) {
    return fail(app::exit_unavailable, error);
  } catch (const telemetry::LcmError& error) {
    return fail(app::exit_unavailable, error);
  } catch (const std::exception& error) {
    return fail(app::exit_ended_early, error);
  }
}
