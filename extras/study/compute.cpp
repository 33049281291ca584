// Settings of a study's runs, and its chunks, several at once, with their rows.
#include "study/compute.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <deque>
#include <filesystem>
#include <iterator>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <utility>

#include "abs_hil/control/registry.hpp"
#include "config/config_error.hpp"
#include "config/script.hpp"
#include "rig/formatted_text.hpp"
#include "run/parallel.hpp"
#include "run/run.hpp"
#include "run_folder/run_folder.hpp"

namespace abs_hil::study {

namespace {

/// Gives an option a value that its key has checked, when the study was read.
void assign(const rig::OptionTarget& target, const config::Value& value) {
  std::visit(
      [&value](auto* to) {
        using To = std::remove_cvref_t<decltype(*to)>;
        if constexpr (std::is_same_v<To, bool> || std::is_same_v<To, std::string>) {
          *to = std::get<To>(value);
        } else if (const auto* whole = std::get_if<std::int64_t>(&value)) {
          *to = static_cast<To>(*whole);
        } else {
          *to = static_cast<To>(std::get<double>(value));
        }
      },
      target);
}

bool equal(const rig::OptionTarget& a, const rig::OptionTarget& b) {
  return std::visit([&b](auto* value) { return *value == *std::get<decltype(value)>(b); }, a);
}

/// Makes the jobs of neighbouring runs, and keeps their settings, which a job only points to. Runs that differ in their
/// varied plant alone share them, since what a batch prepares from settings costs more than a copy.
class Jobs {
 public:
  explicit Jobs(const Study& study) : study_(study), run_(study), latest_(study.contenders(0).size()) {}

  Job job_of(std::uint64_t run) {
    const RunIndex index = study_.index_of(run);
    const config::Settings* settings = &study_.contenders(index.study_case)[index.contender].settings;
    if (!study_.shares_settings()) {
      auto& [at, own] = latest_[index.contender];
      if (own == nullptr || !at.same_settings(index)) own = &settings_.emplace_back(run_.of(index));
      at = index;
      settings = own;
    }
    RunSettings::Drawn drawn = run_.drawn(index);
    return {.settings = settings, .plant = std::move(drawn.plant), .seed = drawn.seed};
  }

 private:
  const Study& study_;
  RunSettings run_;
  std::deque<config::Settings> settings_{};
  std::vector<std::pair<RunIndex, const config::Settings*>> latest_;  ///< by controller
};

/// What the columns `result` and `reason` say.
std::string ending_of(const Outcome& outcome) {
  if (!outcome.refusal.empty()) return "refused," + rig::csv_field(outcome.refusal);
  return outcome.run.stopped() ? "completed," : fmt::format("fault,{}", rig::row_of(outcome.run.fault).name);
}

/// Runs that are planned at once: enough for the threads to stay busy while the last runs of a chunk end.
constexpr std::uint64_t runs_at_once = 8192;

/// The study's own metrics of one run, from its records; the run goes on to the end of its experiment.
std::vector<double> own_metrics(const Study& study, std::uint64_t number) {
  const config::Settings s = settings_of_run(study, number);
  const auto controller = control::make_controller(s.control.controller, {s.control, s.model});
  SignalMetrics metrics(study.script().metrics, controller->signals(), s.plant.rig.wheels.r2_m);
  static_cast<void>(run::simulate(s, *config::find(s.experiment.name), {&metrics}, [] { return rig::Reason::none; }));
  return metrics.values();
}

/// A chunk that is being computed.
struct OpenChunk {
  std::uint64_t number{0};
  std::vector<Outcome> outcomes{};
  std::vector<std::vector<double>> own{};  ///< metrics of the study's own
  std::atomic<std::uint64_t> left{0};
};

/// Runs so far, counted by several threads.
struct Counts {
  std::atomic<std::uint64_t> runs{0};
  std::atomic<std::uint64_t> faults{0};
  std::atomic<std::uint64_t> refused{0};
};

void write(const Study& study, const StudyFolder& folder, OpenChunk& chunk) {
  std::string rows;
  const std::uint64_t first = chunk.number * study.script().chunk;
  for (std::size_t i = 0; i < chunk.outcomes.size(); ++i)
    rows += result_row(study, first + i, chunk.outcomes[i], chunk.own[i]);
  folder.write_chunk(chunk.number, rows);
  chunk.outcomes = {};
  chunk.own = {};
}

/// @param numbers  of chunks with the same number of runs except for the last
/// @param done  told the number of finished runs
void compute_together(const Study& study, const StudyFolder& folder, std::span<const std::uint64_t> numbers,
                      std::size_t threads, Counts& counts, const std::function<void(std::uint64_t)>& done) {
  const std::uint64_t size = study.script().chunk;
  std::deque<OpenChunk> open;
  std::uint64_t runs = 0;
  for (const std::uint64_t number : numbers) {
    OpenChunk& chunk = open.emplace_back();
    chunk.number = number;
    chunk.left = folder.facts().runs_in(number);
    chunk.outcomes.resize(chunk.left);
    chunk.own.resize(chunk.left);
    runs += chunk.left;
  }
  const auto run_of = [&](std::size_t i) { return numbers[i / size] * size + i % size; };
  run_part(study, runs, threads, run_of, [&](std::size_t i, Outcome outcome) {
    OpenChunk& chunk = open[i / size];
    const bool refused = !outcome.refusal.empty();
    if (refused) ++counts.refused;
    if (!refused && !outcome.run.stopped()) ++counts.faults;
    if (!refused && !study.script().metrics.empty()) chunk.own[i % size] = own_metrics(study, run_of(i));
    chunk.outcomes[i % size] = std::move(outcome);
    if (chunk.left.fetch_sub(1) == 1) write(study, folder, chunk);
    done(counts.runs.fetch_add(1) + 1);
  });
}

}  // namespace

RunSettings::RunSettings(const Study& study)
    : study_(study), settings_(study.cases().front().settings), keys_(settings_) {
  for (const Factor& factor : study.script().factors) {
    Target& target = targets_.emplace_back(Target{config::find_key(keys_.keys(), factor.key)->target});
    const config::Key* model = config::model_key(keys_.keys(), factor.key);
    const bool is_factor = model != nullptr && std::ranges::any_of(study.script().factors, [&](const Factor& other) {
                             return other.key == model->name;
                           });
    if (study.script().model_follows_factors() && model != nullptr && !is_factor) target.model = model->target;
  }
  follows_.resize(targets_.size());
}

void RunSettings::take_over(const RunIndex& index) {
  settings_ = study_.contenders(index.study_case)[index.contender].settings;
  for (std::size_t i = 0; i < targets_.size(); ++i) {
    // A value of the model that differs from the plant's was set by somebody: it does not follow (KeyTable).
    const Target& target = targets_[i];
    follows_[i] = target.model && equal(target.value, *target.model);
  }
}

const config::Settings& RunSettings::of(const RunIndex& index) {
  if (at_ && at_->same_settings(index)) return settings_;
  const bool same_base = at_ && at_->study_case == index.study_case && at_->contender == index.contender;
  if (!same_base) take_over(index);
  for (std::size_t i = 0; i < targets_.size(); ++i) {
    const config::Value value = study_.value_of(index, i);
    assign(targets_[i].value, value);
    if (follows_[i]) assign(*targets_[i].model, value);
  }
  at_ = index;
  return settings_;
}

RunSettings::Drawn RunSettings::drawn(const RunIndex& index) {
  const config::Settings& settings = of(index);
  const StudyScript& script = study_.script();
  const auto seed = config::sensor_seed(settings);
  if (script.repeat.variation == Variation{}) return {.plant = settings.plant, .seed = seed};
  const Perturbation perturbation = draw(script.repeat.variation, script.repeat.seed, index.repetition);
  return {.plant = perturbed(settings.plant, perturbation),
          .seed = script.repeat.variation.phase ? perturbation.sensor_seed : seed};
}

config::Settings RunSettings::whole(const RunIndex& index) {
  config::Settings settings = of(index);
  Drawn own = drawn(index);
  settings.plant = std::move(own.plant);
  settings.sensor_seed = std::to_string(own.seed);
  return settings;
}

config::Settings settings_of_run(const Study& study, std::uint64_t number) {
  if (number >= study.runs()) {
    throw config::ConfigError(
        fmt::format("--run {}: there are {} runs; give a number in [0, {}]", number, study.runs(), study.runs() - 1));
  }
  return RunSettings(study).whole(study.index_of(number));
}

void run_part(const Study& study, std::size_t count, std::size_t threads,
              const std::function<std::uint64_t(std::size_t)>& run_of,
              const std::function<void(std::size_t, Outcome)>& take) {
  const std::function<JobSource()> new_source = [&study, &run_of]() -> JobSource {
    return [jobs = std::make_shared<Jobs>(study), &run_of](std::size_t index) { return jobs->job_of(run_of(index)); };
  };
  run_batch(count, threads, new_source, take);
}

std::string result_row(const Study& study, std::uint64_t run, const Outcome& outcome, const std::vector<double>& own) {
  const RunIndex index = study.index_of(run);
  const StudyCase& one = study.cases()[index.study_case];
  std::string row;
  auto out = std::back_inserter(row);
  fmt::format_to(out, "{},{},{},{},{},{}", run, rig::csv_field(one.plant), rig::csv_field(one.experiment),
                 rig::csv_field(study.contenders(index.study_case)[index.contender].name), index.point,
                 index.repetition);
  for (std::size_t i = 0; i < study.script().factors.size(); ++i)
    row += ',' + rig::csv_field(config::text_of(study.value_of(index, i)));
  row += ',' + ending_of(outcome);
  for (const analysis::Figure& figure : analysis::figures) {
    fmt::format_to(out, ",{}", outcome.refusal.empty() ? figure.of(outcome.run.metrics) : rig::unknown);
  }
  for (std::size_t i = 0; i < study.script().metrics.size(); ++i) {
    fmt::format_to(out, ",{}", own.empty() ? rig::unknown : own[i]);
  }
  return row + '\n';
}

std::vector<std::uint64_t> missing_chunks(const StudyFolder& folder, const Shard& shard) {
  std::vector<std::uint64_t> missing;
  if (folder.complete()) return missing;
  const std::vector<bool> finished = folder.finished();
  for (std::uint64_t number = 0; number < finished.size(); ++number) {
    if (shard.has(number) && !(finished[number] && folder.is_whole(number))) missing.push_back(number);
  }
  return missing;
}

std::vector<std::uint64_t> damaged_of(const std::vector<std::uint64_t>& missing, const StudyFolder& folder) {
  std::vector<std::uint64_t> damaged;
  std::ranges::copy_if(missing, std::back_inserter(damaged),
                       [finished = folder.finished()](std::uint64_t number) { return finished[number]; });
  return damaged;
}

Tally compute(const Study& study, const StudyFolder& folder, const Shard& shard, std::size_t threads,
              const Progress& progress) {
  const std::vector<std::uint64_t> chunks = missing_chunks(folder, shard);
  std::vector<std::uint64_t> damaged = damaged_of(chunks, folder);
  std::uint64_t all = 0;
  for (std::uint64_t chunk = 0; chunk < folder.facts().chunks(); ++chunk) {
    if (shard.has(chunk)) all += folder.facts().runs_in(chunk);
  }
  std::uint64_t earlier = all;
  for (const std::uint64_t chunk : chunks) earlier -= folder.facts().runs_in(chunk);
  const auto tell = [&](std::uint64_t done) {
    if (progress) progress(earlier + done, all);
  };
  tell(0);
  Counts counts;
  const std::uint64_t at_once = std::max<std::uint64_t>(1, runs_at_once / study.script().chunk);
  for (std::size_t at = 0; at < chunks.size(); at += at_once) {
    compute_together(study, folder, std::span(chunks).subspan(at, std::min<std::size_t>(at_once, chunks.size() - at)),
                     threads > 0 ? threads : run::machine_threads(), counts, tell);
  }
  return {.earlier = earlier,
          .runs = counts.runs,
          .faults = counts.faults,
          .refused = counts.refused,
          .damaged = std::move(damaged)};
}

std::string folder_of(const std::string& file, const std::optional<std::string>& given) {
  if (given) return *given;
  const std::filesystem::path runs = run_folder::default_runs_dir();
  if (runs.empty()) throw config::ConfigError("ABS_HIL_RUNS_DIR is empty; give the folder of the results with --out");
  return (runs / std::filesystem::path(file).stem()).string();
}

Tally run(const std::string& file, const std::optional<std::string>& folder, const StudyOptions& options,
          const Progress& progress) {
  const Study study = make_study(load_study(file));
  const std::string name = options.name.empty() ? std::filesystem::path(file).stem().string() : options.name;
  const StudyFolder results(folder_of(file, folder), facts_of(study, name));
  const Tally tally = compute(study, results, options.shard, options.threads, progress);
  if (options.shard.of == 1) results.merge({});
  return tally;
}

}  // namespace abs_hil::study
