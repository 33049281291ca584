// From the options of a run as typed to the run: what the merge of the configuration does not know.
#include "program/command_line.hpp"

#include <filesystem>
#include <system_error>

#include "config/config_error.hpp"
#include "files/result_file.hpp"
#include "program/questions.hpp"

namespace abs_hil::program {

namespace {

/// Checks that a run that waits for a start command can receive one.
void check_start(const RunRequest& request) {
  const config::Settings& s = request.settings;
  const auto refuse = [](const char* why) { throw config::ConfigError(std::string("--wait-for-start: ") + why); };
  if (!s.commands.enabled)
    refuse("the start command needs remote commands; add --set commands.enabled=true --set commands.key_file=FILE");
  if (request.outputs.no_lcm) refuse("the start command comes over LCM; leave out --no-lcm");
  if (request.virtual_time) refuse("a run in virtual time cannot wait for a command; leave out --fast");
  if (s.experiment.start_speed_rad_s > 0.0) {
    refuse(
        "wheels that turn from the beginning would slow down during the wait; leave out experiment.start_speed_rad_s");
  }
}

}  // namespace

void keep_inputs(const config::Sources& sources) {
  for (const auto* file : {&sources.config_file, &sources.plant, &sources.model, &sources.experiment}) {
    std::error_code error;
    if (file->has_value() && std::filesystem::is_regular_file(**file, error)) files::note_input(**file);
  }
}

RunRequest merge(const RunOptions& options) {
  if (options.virtual_time && options.outputs.histogram_file) {
    throw config::ConfigError(
        "--histogram: a run in virtual time (--fast) has no latencies to measure; leave out one of the two");
  }
  config::Sources sources = options;
  sources.prior_file = options.outputs.prior_file;
  const bool by_itself = options.backend != "rig" && (options.virtual_time || !at_terminal());
  sources.answered_by = by_itself ? experiment::answers_itself : experiment::answers_person;
  keep_inputs(sources);
  RunRequest request{config::merge(sources), options.outputs, options.virtual_time};
  if (request.settings.experiment.wait_for_start) check_start(request);
  return request;
}

}  // namespace abs_hil::program
