// The options of `abs_hil compare`.
#include <memory>

#include "program/run_arguments.hpp"
#include "program/subcommands.hpp"

namespace abs_hil::program {

Action add_compare(cli::Parser& compare, const Words& words) {
  const auto options = std::make_shared<CompareOptions>();
  CompareOptions& o = *options;
  compare.add({.names = "--plant", .to = &o.run.plant, .help = "plant by name or TOML file", .type = "NAME|FILE"});
  compare.add({.names = "--model",
               .to = &o.run.model,
               .help = "every controller's model (default: the plant, before it varies)",
               .type = "NAME|FILE"});
  compare.add({.names = "--controllers",
               .to = &o.controllers,
               .help = "controllers, the first one the baseline: NAME, NAME{key=value,...}, a TOML file, each with "
                       "LABEL= before it if you like; or all",
               .type = "A,B,...",
               .show_default = true});
  compare.add({.names = "--repeat",
               .to = &o.repeat,
               .help = "runs of each controller",
               .type = "N",
               .range = {1, 1'000'000},
               .show_default = true});
  compare.add(
      {.names = "--seed", .to = &o.seed, .help = "seed of the varied plants", .type = "N", .show_default = true});
  compare.add({.names = "--vary",
               .to = &o.vary,
               .help = "what varies: parameters (wheels, brake, tyre), theta, radii, phase, or none",
               .type = "SPEC",
               .default_text = "parameters=0.1,theta=0.1,phase"});
  add_config_file(compare, o.run);
  add_assignments(compare, o.run);
  compare.add({.names = "--threads",
               .to = &o.threads,
               .help = "number of threads, 0: one for each processor; does not change the results",
               .type = "N",
               .range = {0, 1024},
               .show_default = true});
  compare.add({.names = "--json", .to = &o.json_file, .help = "write the table as JSON", .type = "FILE"});
  compare.add({.names = "--csv", .to = &o.csv_file, .help = "write the table as CSV", .type = "FILE"});
  compare.add({.names = "--markdown", .to = &o.markdown_file, .help = "write the table as Markdown", .type = "FILE"});
  compare.add({.names = "--runs", .to = &o.runs_file, .help = "write each run's results as CSV", .type = "FILE"});
  compare.add({.names = "--run",
               .to = &o.recorded_run,
               .help = "repeat run K of each controller (see --runs) with everything recorded, and compare nothing",
               .type = "K",
               .range = {0, 999'999},
               .excludes = {"--json", "--csv", "--markdown", "--runs"}});
  compare.add({.names = "--out",
               .to = &o.run_folder,
               .help = "run folder of --run; with several controllers one below it for each",
               .type = "DIR",
               .needs = {"--run"}});
  compare.set_footer("To compare runs that are already recorded, use abs_report RUN RUN.");
  return [options, words] { return program::compare(*options, words); };
}

}  // namespace abs_hil::program
