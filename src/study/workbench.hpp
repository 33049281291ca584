// Makes the settings of a study's runs.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "config/key_table.hpp"
#include "study/study.hpp"

namespace abs_hil::study {

/// Makes the settings of a study's runs, one after the other, without copying those that stay the same. Not
/// thread-safe: each thread has its own.
class Workbench {
 public:
  /// @param study  must outlive it
  explicit Workbench(const Study& study);
  Workbench(const Workbench&) = delete;
  Workbench& operator=(const Workbench&) = delete;

  /// The settings of a run with its factors, before the repetition varies the plant. Valid until the next call.
  const config::Settings& settings_of(const RunIndex& index);
  /// The plant of a run, varied by its repetition, and the simulator's seed.
  struct Drawn {
    plant_sim::PlantOptions plant{};
    std::uint64_t seed{1};
  };
  [[nodiscard]] Drawn drawn(const RunIndex& index);

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

}  // namespace abs_hil::study
