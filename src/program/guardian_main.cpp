// The program abs_guardian: the resident service, or the guardian that a run has started.
#include <cstdio>
#include <exception>
#include <string_view>

#include "abs_hil/driver/backend.hpp"
#include "abs_hil/program/program.hpp"
#include "cli/command_line.hpp"
#include "guardian/guardian_program.hpp"
#include "version/build_facts.hpp"

namespace abs_hil {

int program::run_guardian(int argc, char** argv, std::span<const driver::Backend> boards) {
  try {
    for (const driver::Backend& board : boards) driver::register_backend(board);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "abs_guardian: %s\n", error.what());
    return guardian::exit_usage;
  }
  const std::string_view first = argc > 1 ? argv[1] : "";
  if (first == "serve") return cli::with_stdout("abs_guardian", guardian::serve(argc, argv));
  if (argc == 2 && (first == "--help" || first == "-h" || first == "--version")) {
    std::puts(first == "--version" ? version::version_line("abs_guardian").c_str()
                                   : "Usage: abs_guardian serve [--socket PATH] [--config FILE]\n"
                                     "                          [--set key=value]...\n\n"
                                     "The guardian of the rig's outputs. When a controller dies,\n"
                                     "stops or hangs, it brings the outputs into the safe state.\n"
                                     "`serve` is the resident service: it keeps the outputs at\n"
                                     "zero and grants them to one run at a time. Its options:\n"
                                     "abs_guardian serve --help. Without the service abs_hil\n"
                                     "starts a guardian for each run on a board; do not start\n"
                                     "that one by hand (docs/dead-man.md).");
    return cli::with_stdout("abs_guardian", 0);
  }
  if (argc != 1 || !guardian::started_by_a_run()) {
    std::fputs(
        "abs_guardian: without `serve`, only abs_hil can start this program, as the guardian of a run. The resident "
        "service is `abs_guardian serve` (docs/dead-man.md)\n",
        stderr);
    return guardian::exit_usage;
  }
  return guardian::guard_one_run();
}

}  // namespace abs_hil
