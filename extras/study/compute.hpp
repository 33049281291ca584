// The runs of a study: what each is made of, many of them computed together, and chunks of rows in the study's folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "config/key_table.hpp"
#include "study/batch.hpp"
#include "study/study.hpp"
#include "study/study_folder.hpp"

namespace abs_hil::study {

/// Makes the settings of a study's runs, one run after another. It sets only the values that differ from the run
/// before. Not thread-safe: each thread has its own.
class RunSettings {
 public:
  /// @param study  must outlive it
  explicit RunSettings(const Study& study);
  RunSettings(const RunSettings&) = delete;
  RunSettings& operator=(const RunSettings&) = delete;

  /// The settings of a run with its factors, before the repetition varies the plant. Valid until the next call.
  const config::Settings& of(const RunIndex& index);
  /// The plant of a run, varied by its repetition, and the simulator's seed.
  struct Drawn {
    plant_sim::PlantOptions plant{};
    std::uint64_t seed{1};
  };
  [[nodiscard]] Drawn drawn(const RunIndex& index);
  /// The whole settings of a run: with its varied plant and its seed.
  [[nodiscard]] config::Settings whole(const RunIndex& index);

 private:
  /// Where the value of a factor goes.
  struct Target {
    rig::OptionTarget value;
    std::optional<rig::OptionTarget> model{};  ///< of the same value in the model, which may follow
  };

  void take_over(const RunIndex& index);

  const Study& study_;
  config::Settings settings_;
  config::KeyTable keys_;
  std::vector<Target> targets_{};
  std::vector<bool> follows_{};  ///< by factor: the model of the present controller follows it
  std::optional<RunIndex> at_{};
};

/// The whole settings of one run of a study. Throws config::ConfigError unless the study has a run of this number.
[[nodiscard]] config::Settings settings_of_run(const Study& study, std::uint64_t number);

/// Runs some of a study's runs, in any order. The memory that it takes does not grow with `count`.
/// @param run_of  the number of the run in the study, for index 0 to count - 1; called from several threads
/// @param take  takes the outcome of that index; called from several threads. An exception of it ends the part and
///   leaves it.
void run_part(const Study& study, std::size_t count, std::size_t threads,
              const std::function<std::uint64_t(std::size_t index)>& run_of,
              const std::function<void(std::size_t index, Outcome outcome)>& take);

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

/// What of a study its file does not say.
struct StudyOptions {
  Shard shard{};
  std::size_t threads{0};  ///< 0: one for each processor
  std::string name{};      ///< in the results; empty: the name of the file without its ending
};

/// The folder of a study's results: the given one, or one of the file's name below runs/. Throws config::ConfigError
/// where that is switched off.
[[nodiscard]] std::string folder_of(const std::string& file, const std::optional<std::string>& given);

/// A study as `abs_hil study FILE --out FOLDER`: computes what the folder lacks of the shard, and puts the results
/// together unless others compute the other shards. The one entry of program and Python. Throws config::ConfigError
/// for a study that cannot be used, std::runtime_error if a file cannot be written, and what `progress` throws.
Tally run(const std::string& file, const std::optional<std::string>& folder, const StudyOptions& options,
          const Progress& progress);

/// Computes the chunks of a shard that the folder lacks, and writes each as soon as it is finished. The bytes do not
/// depend on the threads. Memory does not grow with the number of chunks.
/// @param threads  0: one for each processor
/// Throws std::runtime_error if a file cannot be written.
Tally compute(const Study& study, const StudyFolder& folder, const Shard& shard, std::size_t threads,
              const Progress& progress);

}  // namespace abs_hil::study
