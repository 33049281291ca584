// Computes the runs of a study: chunks of rows in the study's folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "study/batch.hpp"
#include "study/study.hpp"
#include "study/study_folder.hpp"

namespace abs_hil::study {

/// A row of a study's results with a line end; the same for the same run on every computer. The columns are those of
/// `facts_of`.
/// @param own  the study's own metrics, in order; empty: all unknown
[[nodiscard]] std::string result_row(const Study& study, std::uint64_t run, const Outcome& outcome,
                                     const std::vector<double>& own = {});

/// One of several shares of a study's chunks: every `of`-th one.
struct Shard {
  std::uint64_t number{1};  ///< from 1
  std::uint64_t of{1};
  [[nodiscard]] bool has(std::uint64_t chunk) const noexcept { return chunk % of == number - 1; }
};

/// The chunks of a shard whose file is missing or damaged, in order. Reads the files.
[[nodiscard]] std::vector<std::uint64_t> missing_chunks(const StudyFolder& folder, const Shard& shard);

/// Those of the missing chunks whose file is there: damaged ones.
[[nodiscard]] std::vector<std::uint64_t> damaged_of(const std::vector<std::uint64_t>& missing,
                                                    const StudyFolder& folder);

/// What became of runs.
struct Tally {
  std::uint64_t earlier{0};  ///< were there already; all others are those computed now
  std::uint64_t runs{0};
  std::uint64_t faults{0};               ///< ended early
  std::uint64_t refused{0};              ///< could not begin, for their combination of values
  std::vector<std::uint64_t> damaged{};  ///< chunks that were there, damaged, and are computed anew
};

/// Tells how many of all runs of the shard are done, those of earlier calls among them. Called from several threads,
/// after each run, and once before the first.
using Progress = std::function<void(std::uint64_t done, std::uint64_t all)>;

/// Computes the chunks of a shard that the folder lacks, and writes each as soon as it is finished. The bytes do not
/// depend on the threads. Memory does not grow with the number of chunks.
/// @param threads  0: one for each processor
/// Throws std::runtime_error if a file cannot be written.
Tally compute(const Study& study, const StudyFolder& folder, const Shard& shard, std::size_t threads,
              const Progress& progress);

}  // namespace abs_hil::study
