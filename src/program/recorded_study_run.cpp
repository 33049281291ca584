// A single run of a study with everything recorded, as the program runs it.
#include "program/study_runs.hpp"
#include "program/subcommands.hpp"

namespace abs_hil::program {

int record_run(const study::Study& study, std::uint64_t number, const std::optional<std::string>& folder,
               const std::vector<std::string>& command_line) {
  RunRequest request = request_of(settings_of_run(study, number), {.fast = true, .no_lcm = true, .run_folder = folder});
  request.command_line = command_line;
  return run(request);
}

}  // namespace abs_hil::program
