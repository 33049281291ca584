// Runs the chunks of a study, several at once, and writes their rows.
#include "study/compute.hpp"

#include <algorithm>
#include <atomic>
#include <memory>
#include <utility>

#include "study/result_rows.hpp"
#include "study/run_part.hpp"

namespace abs_hil::study {

namespace {

/// Runs that are planned at once: enough for the threads to stay busy while the last runs of a chunk end.
constexpr std::uint64_t runs_at_once = 8192;

/// A chunk that is being computed.
struct OpenChunk {
  std::uint64_t number{0};
  std::vector<Outcome> outcomes{};
  std::vector<std::vector<double>> own{};  ///< metrics of the study's own
  std::atomic<std::uint64_t> left{0};
};

class Computation {
 public:
  Computation(const Study& study, const StudyFolder& folder, std::size_t threads, const OwnMetrics& own,
              const std::function<void(std::uint64_t)>& done)
      : study_(study), folder_(folder), threads_(threads), own_(own), done_(done) {}

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
      if (!study_.script().metrics.empty() && outcome.refusal.empty()) chunk.own[i % size] = own_(study_, run_of(i));
      chunk.outcomes[i % size] = std::move(outcome);
      if (chunk.left.fetch_sub(1) == 1) write(chunk);
      const std::uint64_t finished = runs_.fetch_add(1) + 1;
      if (done_) done_(finished);
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
  const OwnMetrics& own_;
  const std::function<void(std::uint64_t)>& done_;
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
    if (!finished[number] && shard.has(number)) missing.push_back(number);
  }
  return missing;
}

Tally compute(const Study& study, const StudyFolder& folder, const std::vector<std::uint64_t>& chunks,
              std::size_t threads, const OwnMetrics& own, const std::function<void(std::uint64_t)>& done) {
  Computation computation(study, folder, threads, own, done);
  const std::uint64_t at_once = std::max<std::uint64_t>(1, runs_at_once / study.script().chunk);
  for (std::size_t at = 0; at < chunks.size(); at += at_once) {
    computation.run(chunks.data() + at, std::min<std::size_t>(at_once, chunks.size() - at));
  }
  return computation.tally();
}

}  // namespace abs_hil::study
