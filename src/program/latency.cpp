#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <optional>

#include "config/config_error.hpp"
#include "diagnosis/latency_verdict.hpp"
#include "experiment/run_session.hpp"
#include "experiment/timing_load.hpp"
#include "files/result_file.hpp"
#include "program/exit_status.hpp"
#include "program/run_parts.hpp"
#include "program/signals.hpp"
#include "program/subcommands.hpp"
#include "runtime/histogram_file.hpp"

namespace abs_hil::program {

int latency(const RunRequest& request, const LatencyOptions& options) {
  config::Settings s = request.settings;
  s.experiment.start_speed_rad_s = experiment::timing_load_start_speed_rad_s;
  // Gaps in the simulation are what this command measures; they must not end it.
  constexpr double any_gap_s = 3600.0;
  if (s.backend == "sim") s.realtime.overruns.cycle_gap_max_s = any_gap_s;
  std::optional<files::ResultFile> histogram;
  try {
    if (request.outputs.histogram_file) histogram.emplace(*request.outputs.histogram_file, "histogram");
  } catch (const std::runtime_error& error) {
    throw config::ConfigError(error.what());
  }
  const std::unique_ptr<driver::RigDriver> driver = make_driver(s, false);
  runtime::MonotonicClock clock;
  experiment::RunSession session(clock, *driver, make_logic(s, experiment::plan_timing_load(options.duration_s)),
                                 s.gate, {}, s.realtime.overruns);
  if (options.second_offset_us) session.align_to_second(std::int64_t{*options.second_offset_us} * 1000);
  note_signals();
  const diagnosis::MachineFacts facts = diagnosis::read_machine_facts();
  const experiment::RunOutcome outcome = session.run_realtime(s.realtime, signalled);
  if (!outcome.ran) throw driver::Unavailable(realtime_refusal(outcome.realtime));

  const runtime::CycleStatistics& statistics = session.executive().statistics();
  const diagnosis::LatencyRun run{.rate_Hz = s.control.rate_Hz,
                                  .duration_s = options.duration_s,
                                  .cycles = statistics.cycles(),
                                  .realtime = outcome.realtime.realtime(),
                                  .timing = statistics.summary()};
  if (histogram) histogram->write(runtime::cyclictest_histogram(statistics));
  fmt::print("{}", options.json ? to_json(run, facts).dump(2) + "\n" : to_text(run, facts));
  return status_of(outcome);
}

}  // namespace abs_hil::program
