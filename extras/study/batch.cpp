// Parts of a batch: runs begin in lanes if lanes know them, and go on alone if not.
#include "study/batch.hpp"

#include <algorithm>
#include <atomic>
#include <map>
#include <memory>
#include <stdexcept>
#include <tuple>
#include <utility>
#include <vector>

#include "config/config_error.hpp"
#include "run/parallel.hpp"
#include "study/lanes/lane_jobs.hpp"

namespace abs_hil::study {

namespace {

/// Runs that are computed together: enough to keep lanes full, few enough for the processor's cache.
constexpr std::size_t most_together = 768;

/// What the runs with the same settings share, each made when the first run needs it.
struct SharedBySettings {
  std::unique_ptr<lanes::LaneSettings> lanes{};
  std::unique_ptr<run::Prepared> prepared{};
};

Outcome outcome_of(const Job& job, SharedBySettings& shared) {
  try {
    if (!shared.prepared) shared.prepared = std::make_unique<run::Prepared>(*job.settings);
    return {.run = simulate(*shared.prepared, job.plant, job.seed)};
  } catch (const config::ConfigError& error) {
    return {.refusal = error.what()};
  } catch (const std::invalid_argument& error) {
    return {.refusal = error.what()};
  }
}

/// The jobs of one part of a batch.
class Part {
 public:
  using Take = std::function<void(std::size_t, Outcome)>;

  Part(lanes::InstructionSet set, const Take& take) : set_(set), take_(take) {}

  void start(std::size_t index, Job job) {
    if (set_ != lanes::InstructionSet::none) {
      auto& settings = shared_[job.settings].lanes;
      if (!settings) settings = std::make_unique<lanes::LaneSettings>(*job.settings);
      lanes::Started run{.index = index, .job = std::move(job)};
      if (const lanes::Kind* kind = settings->begin(run)) {
        groups_[{kind, settings->window_cycles(), run.job.plant.ideal_actuator}].push_back(std::move(run));
        return;
      }
      job = std::move(run.job);
    }
    ++counts_.scalar;
    take_(index, outcome_of(job, shared_[job.settings]));
  }
  void finish() {
    for (auto& [key, group] : groups_) {
      const auto& [kind, window_cycles, ideal_actuator] = key;
      lanes::go_on(*kind, set_, group, window_cycles);
      for (const lanes::Started& started : group) {
        Outcome outcome;
        const bool complete = lanes::result_of(*kind, started.words.data(), outcome.run);
        ++(complete ? counts_.lanes : counts_.disturbed);
        take_(started.index, complete ? outcome : outcome_of(started.job, shared_[started.job.settings]));
      }
    }
  }
  [[nodiscard]] const BatchCounts& counts() const noexcept { return counts_; }

 private:
  lanes::InstructionSet set_;
  const Take& take_;
  std::map<const config::Settings*, SharedBySettings> shared_;
  /// Kind, cycles of the gate's speed windows, and whether the brake is ideal: a law may compute one or the other.
  using Alike = std::tuple<const lanes::Kind*, std::uint32_t, bool>;
  std::map<Alike, std::vector<lanes::Started>> groups_;
  BatchCounts counts_{};
};

}  // namespace

BatchCounts run_batch(std::size_t count, std::size_t threads, const std::function<JobSource()>& new_source,
                      const std::function<void(std::size_t, Outcome)>& take) {
  const lanes::InstructionSet set = lanes::instruction_set();
  const std::size_t share = (count + std::max<std::size_t>(threads, 1) - 1) / std::max<std::size_t>(threads, 1);
  const std::size_t together = std::clamp<std::size_t>(share, 1, most_together);
  std::atomic<std::size_t> in_lanes{0};
  std::atomic<std::size_t> disturbed{0};
  std::atomic<std::size_t> scalar{0};
  run::for_each_index((count + together - 1) / together, threads, [&](std::size_t part_index) {
    const JobSource job_of = new_source();
    Part part(set, take);
    const std::size_t end = std::min(count, (part_index + 1) * together);
    for (std::size_t index = part_index * together; index < end; ++index) part.start(index, job_of(index));
    part.finish();
    in_lanes += part.counts().lanes;
    disturbed += part.counts().disturbed;
    scalar += part.counts().scalar;
  });
  return {.lanes = in_lanes, .disturbed = disturbed, .scalar = scalar};
}

}  // namespace abs_hil::study
