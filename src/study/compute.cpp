// Runs the chunks of a study, several at once, and writes their rows.
#include "study/compute.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <iterator>
#include <memory>
#include <utility>

#include "abs_hil/control/registry.hpp"
#include "config/script.hpp"
#include "run/run_summary.hpp"
#include "study/parallel.hpp"
#include "study/runs.hpp"

namespace abs_hil::study {

namespace {

std::string text_of(const config::Value& value) {
  if (const auto* text = std::get_if<std::string>(&value)) return csv_field(*text);
  return std::visit([](const auto& v) { return fmt::format("{}", v); }, value);
}

/// What the columns `result` and `reason` say.
std::string ending_of(const Outcome& outcome) {
  if (!outcome.refusal.empty()) return "refused," + csv_field(outcome.refusal);
  return outcome.run.stopped() ? "completed," : fmt::format("fault,{}", rig::row_of(outcome.run.fault).name);
}

}  // namespace

std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + '"';
}

std::string result_row(const Study& study, std::uint64_t run, const Outcome& outcome, const std::vector<double>& own) {
  const RunIndex index = study.index_of(run);
  const StudyCase& one = study.cases()[index.study_case];
  std::string row;
  auto out = std::back_inserter(row);
  fmt::format_to(out, "{},{},{},{},{},{}", run, csv_field(one.plant), csv_field(one.experiment),
                 csv_field(study.contenders(index.study_case)[index.contender].name), index.point, index.repetition);
  for (std::size_t i = 0; i < study.script().factors.size(); ++i) row += ',' + text_of(study.value_of(index, i));
  row += ',' + ending_of(outcome);
  for (const analysis::Figure& figure : analysis::figures) {
    fmt::format_to(out, ",{}", outcome.refusal.empty() ? figure.of(outcome.run.metrics) : rig::unknown);
  }
  for (std::size_t i = 0; i < study.script().metrics.size(); ++i) {
    fmt::format_to(out, ",{}", own.empty() ? rig::unknown : own[i]);
  }
  return row + '\n';
}

namespace {

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

class Computation {
 public:
  Computation(const Study& study, const StudyFolder& folder, std::size_t threads,
              std::function<void(std::uint64_t)> done)
      : study_(study), folder_(folder), threads_(threads), done_(std::move(done)) {}

  /// @param first  number of the first chunk, of `count` with the same number of runs except for the last
  void run(const std::uint64_t* first, std::size_t count) {
    const std::uint64_t size = study_.script().chunk;
    std::vector<std::unique_ptr<OpenChunk>> open(count);
    std::uint64_t runs = 0;
    for (std::size_t i = 0; i < count; ++i) {
      open[i] = std::make_unique<OpenChunk>();
      open[i]->number = first[i];
      open[i]->left = study_.runs_in(first[i]);
      open[i]->outcomes.resize(open[i]->left);
      open[i]->own.resize(open[i]->left);
      runs += open[i]->left;
    }
    const auto run_of = [&](std::size_t i) { return first[i / size] * size + i % size; };
    run_part(study_, runs, threads_, run_of, [&](std::size_t i, Outcome outcome) {
      OpenChunk& chunk = *open[i / size];
      count_in(outcome);
      if (!study_.script().metrics.empty() && outcome.refusal.empty())
        chunk.own[i % size] = own_metrics(study_, run_of(i));
      chunk.outcomes[i % size] = std::move(outcome);
      if (chunk.left.fetch_sub(1) == 1) write(chunk);
      const std::uint64_t finished = runs_.fetch_add(1) + 1;
      done_(finished);
    });
  }

  [[nodiscard]] Tally tally() const { return {.runs = runs_, .faults = faults_, .refused = refused_}; }

 private:
  void count_in(const Outcome& outcome) {
    if (!outcome.refusal.empty()) {
      ++refused_;
    } else if (!outcome.run.stopped()) {
      ++faults_;
    }
  }

  void write(OpenChunk& chunk) const {
    std::string rows;
    const std::uint64_t first = chunk.number * study_.script().chunk;
    for (std::size_t i = 0; i < chunk.outcomes.size(); ++i)
      rows += result_row(study_, first + i, chunk.outcomes[i], chunk.own[i]);
    folder_.write_chunk(chunk.number, rows);
    chunk.outcomes = {};
    chunk.own = {};
  }

  const Study& study_;
  const StudyFolder& folder_;
  std::size_t threads_;
  std::function<void(std::uint64_t)> done_;
  std::atomic<std::uint64_t> runs_{0};
  std::atomic<std::uint64_t> faults_{0};
  std::atomic<std::uint64_t> refused_{0};
};

}  // namespace

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
  for (const std::uint64_t chunk : chunks) all += study.runs_in(chunk);
  const auto tell = [&progress, all](std::uint64_t done) {
    if (progress) progress(done, all);
  };
  tell(0);
  Computation computation(study, folder, threads > 0 ? threads : machine_threads(), tell);
  const std::uint64_t at_once = std::max<std::uint64_t>(1, runs_at_once / study.script().chunk);
  for (std::size_t at = 0; at < chunks.size(); at += at_once) {
    computation.run(chunks.data() + at, std::min<std::size_t>(at_once, chunks.size() - at));
  }
  Tally tally = computation.tally();
  tally.damaged = std::move(damaged);
  return tally;
}

}  // namespace abs_hil::study
