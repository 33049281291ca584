// Many simulated runs, as many as possible side by side in the lanes of vectors.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

#include "abs_hil/plant_sim/options.hpp"
#include "analysis/run_metrics.hpp"
#include "config/settings.hpp"
#include "run/run.hpp"

namespace abs_hil::study {

/// Result of a simulated run.
struct RunResult {
  analysis::Metrics metrics{};
  rig::Reason fault{rig::Reason::none};  ///< reason of an early end; the metrics then cover the run up to it
  [[nodiscard]] bool stopped() const noexcept { return fault == rig::Reason::none; }
};

/// Runs one experiment in virtual time in the calling thread, through the program's own cycle, until its metrics are
/// complete. It leaves out the hold phase after braking. The result depends on the arguments alone, not on the thread.
/// @param plant  the true parameters of the rig
/// @param seed  seed of the simulator: the encoders' initial position within a count
/// Throws std::invalid_argument for unusable options.
[[nodiscard]] inline RunResult simulate(const run::Prepared& prepared, const plant_sim::PlantOptions& plant,
                                        std::uint64_t seed) {
  run::Run run(prepared, {.stepped = true, .plant = &plant, .sensor_seed = seed});
  run.begin();
  while (run.cycle() && !run.metrics().complete()) {
  }
  // The last cycle of a complete sequence has a reason that is not a fault; an early end has a limit or fault.
  const rig::Reason end = run.end_reason();
  return {.metrics = run.metrics().metrics(), .fault = rig::is_fault(end) ? end : rig::Reason::none};
}

/// One run of a batch: the arguments of `simulate`.
struct Job {
  const config::Settings* settings{nullptr};  ///< must outlive the job's source
  plant_sim::PlantOptions plant{};
  std::uint64_t seed{1};
};

/// What became of a job.
struct Outcome {
  RunResult run{};
  std::string refusal{};  ///< why the job's options cannot be used; empty if they can
};

/// How the runs of a batch were computed.
struct BatchCounts {
  std::size_t lanes{0};      ///< side by side, in the lanes of packs
  std::size_t disturbed{0};  ///< begun in lanes, then computed anew by `simulate`: lanes know no limits and no alarms
  std::size_t scalar{0};     ///< by `simulate` alone
};

/// Gives job number `index`. It owns what its jobs point to.
using JobSource = std::function<Job(std::size_t index)>;

/// Runs jobs 0 to count - 1 in any order. The result of a job depends on the job alone: not on its neighbours, the
/// number of threads or the order.
/// @param new_source  makes the source of a part of neighbouring jobs, which lives until the part is done and is asked
///   in the order of the index; called from several threads
/// @param take  takes the outcome of job number `index`; called from several threads. An exception of either ends the
///   batch and leaves it.
/// Runs that brake from a start speed are computed side by side in the lanes of vectors, with the bits of `simulate`:
/// ABS_HIL_LANES=none, portable, avx2 or avx512 chooses the vectors, otherwise the computer does. Throws
/// std::invalid_argument for a choice that the computer has not.
BatchCounts run_batch(std::size_t count, std::size_t threads, const std::function<JobSource()>& new_source,
                      const std::function<void(std::size_t index, Outcome outcome)>& take);

/// The same for jobs whose settings outlive the batch. @param job_of  called from several threads
inline BatchCounts run_batch(std::size_t count, std::size_t threads, const JobSource& job_of,
                             const std::function<void(std::size_t index, Outcome outcome)>& take) {
  return run_batch(count, threads, std::function<JobSource()>([&job_of] { return job_of; }), take);
}

}  // namespace abs_hil::study
