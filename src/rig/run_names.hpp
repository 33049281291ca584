#pragma once

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

#include "abs_hil/rig/cycle_record.hpp"

namespace abs_hil::rig {

/// Longest name of a phase, bytes. A name has no quotes, commas and line ends.
inline constexpr std::size_t phase_name_max = 40;

/// A phase of an experiment: its kind, and the name that the experiment gives it.
struct NamedPhase {
  Phase kind{Phase::idle};
  std::string name{};
  std::string question{};  ///< what it asks a person; empty: nothing
};

/// The names behind the numbers in one run's records, for files and messages.
struct RunNames {
  std::vector<NamedPhase> phases{};    ///< by CycleRecord::phase_index
  std::vector<std::string> signals{};  ///< of the controller, by index into ControlState::signals

  /// True if the experiment gives a phase a name that its kind does not have.
  [[nodiscard]] bool has_own_phase_names() const noexcept {
    return std::any_of(phases.begin(), phases.end(), [](const NamedPhase& phase) {
      return !phase.name.empty() && phase.name != name_of(phase.kind);
    });
  }
  /// What the record's phase asks a person; empty: nothing.
  [[nodiscard]] std::string_view question_of(const CycleRecord& record) const noexcept {
    if (record.phase_index >= phases.size() || phases[record.phase_index].kind != record.phase) return {};
    return phases[record.phase_index].question;
  }
  /// Name of the record's phase: the experiment's own, or the kind's for a phase that the experiment does not plan, as
  /// after a fault.
  [[nodiscard]] std::string_view phase_of(const CycleRecord& record) const noexcept {
    if (record.phase_index < phases.size()) {
      const NamedPhase& named = phases[record.phase_index];
      if (named.kind == record.phase && !named.name.empty()) return named.name;
    }
    return name_of(record.phase);
  }
};

}  // namespace abs_hil::rig
