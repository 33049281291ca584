// Runs of a batch in lanes: which runs lanes know, how one begins, goes on and ends.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "abs_hil/plant_sim/plant.hpp"
#include "study/batch.hpp"

namespace abs_hil::study::lanes {

/// Instruction sets with lanes.
enum class InstructionSet : std::uint8_t { none, portable, avx2, avx512 };

/// The widest one that this computer has. The environment variable ABS_HIL_LANES names another: avx512, avx2, portable,
/// or none for the scalar path alone. Throws std::invalid_argument for an unknown one, and for one that the computer
/// has not.
[[nodiscard]] InstructionSet instruction_set();

/// A combination of law, tyre and load with lanes.
struct Kind;

/// A run under way.
struct Started {
  std::size_t index;
  Job job;
  std::vector<double> words{};
  /// For the cycles that lanes cannot compute. Null: not needed so far.
  std::unique_ptr<plant_sim::Plant> plant{};
  std::int64_t plant_cycles{0};  ///< that `plant` has passed
};

/// What all jobs with the same settings have in common, prepared once.
class LaneSettings {
 public:
  /// @param settings  must outlive this object
  explicit LaneSettings(const config::Settings& settings);
  ~LaneSettings();
  LaneSettings(const LaneSettings&) = delete;
  LaneSettings& operator=(const LaneSettings&) = delete;

  /// Begins a run. Null if it is not for lanes: its controller, plant or experiment, or options that `simulate`
  /// refuses.
  [[nodiscard]] const Kind* begin(Started& run) const;
  /// Cycles of the gate's speed windows.
  [[nodiscard]] std::uint32_t window_cycles() const noexcept;

  struct Parts;

 private:
  std::unique_ptr<Parts> parts_;  ///< null: not for lanes
};

/// Goes on with runs of one kind until each is complete or disturbed.
void go_on(const Kind& kind, InstructionSet set, std::span<Started> runs, std::uint32_t window_cycles);

/// The result of a run that is complete; false if `simulate` has to compute it.
[[nodiscard]] bool result_of(const Kind& kind, const double* words, RunResult& result);

}  // namespace abs_hil::study::lanes
