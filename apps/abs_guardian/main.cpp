// The guardian of the rig's outputs (docs/dead-man.md). abs_hil starts one for a run on a board; `abs_guardian serve`
// is the resident service, which grants leases to runs.

#include <cstdio>
#include <string_view>

#include "guard_of_run.hpp"
#include "process_set_up.hpp"
#include "service.hpp"

int main(int argc, char** argv) {
  using namespace abs_hil;
  const std::string_view first = argc > 1 ? argv[1] : "";
  if (first == "serve") return app::serve(argc, argv);
  if (first == "--help" && argc == 2) {
    std::puts(
        "Usage: abs_guardian serve [--socket PATH] [--config FILE] [--set key=value]...\n\n"
        "The guardian of the rig's outputs. When a controller dies, stops or hangs, it brings the outputs into the "
        "safe "
        "state.\n`serve` is the resident service: it keeps the outputs at zero and grants them to one run at a time. "
        "`abs_guardian serve --help` names its options.\nWithout the service abs_hil starts a guardian for each run on "
        "a board; do not start that one by hand (docs/dead-man.md).");
    return 0;
  }
  if (argc != 1 || !app::started_by_a_run()) {
    std::fputs(
        "abs_guardian: without `serve`, only abs_hil can start this program, as the guardian of a run. The resident "
        "service is `abs_guardian serve` (docs/dead-man.md)\n",
        stderr);
    return app::exit_usage;
  }
  return app::guard_one_run();
}
