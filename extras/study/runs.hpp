// The runs of a study: what each is made of, and many of them computed together.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "config/key_table.hpp"
#include "study/batch.hpp"
#include "study/study.hpp"

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

}  // namespace abs_hil::study
