// From what a person says, and the files that it names, to the effective configuration of one run.
#pragma once

#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/board_policy.hpp"
#include "config/config_file.hpp"
#include "config/script.hpp"
#include "config/settings.hpp"

namespace abs_hil::config {

/// What the values of one run come from: files by name, and values as typed.
struct Sources {
  std::string backend{"sim"};
  std::optional<std::string> prior_file{};
  std::optional<std::string> config_file{};
  std::optional<std::string> plant{};
  std::optional<std::string> model{};
  std::optional<std::string> controller{};
  std::optional<std::string> experiment{};
  std::optional<std::string> slip_ref{};
  std::optional<std::string> rate_Hz{};
  std::optional<std::string> seed{};
  std::vector<std::string> defaults{};  ///< assignments of lowest priority, below files and options
  std::vector<std::string> assignments{};
  std::vector<FileValue> changes{};  ///< values as they are, above all others: of a study, a series, Python
  bool one_of_series{false};         ///< the run's script is one run of the series that its file describes
  bool wait_for_start{false};
  std::vector<std::string> injections{};  ///< faults to inject, in addition to those of run.inject
  std::optional<std::string> realtime{};  ///< --rt; none: require on a real board, otherwise prefer
  bool virtual_time{false};               ///< as fast as possible, not in real time
  /// A person or the simulation itself answers an experiment's questions if experiment.answers is auto.
  std::string answered_by{experiment::answers_itself};
};

/// The effective configuration of one run.
struct Configuration {
  Settings settings{};
  std::shared_ptr<const Script> script{};  ///< the experiment
  std::string json{};
  std::string toml{};  ///< the same, as a file for --config
};

/// Merges defaults, plant file, model file, the script's settings, prior, configuration file, named options,
/// assignments and changes; later ones win. Warns, once in a process, of values that look like a mistake. Throws
/// ConfigError.
[[nodiscard]] Configuration merge(const Sources& sources);
/// The settings alone, without the texts, which cost as much again.
[[nodiscard]] Settings merged_settings(const Sources& sources);
/// What a run from these sources may do on a board, before anything has judged it. Throws ConfigError.
[[nodiscard]] SafetyView safety_view(const Sources& sources);
/// The configuration of these settings, as a merge left them or with other values since.
[[nodiscard]] Configuration configuration_of(Settings settings);

/// The sources of a run in virtual time from pairs of words: "--controller", "adaptive", "--set",
/// "control.slip_ref=0.2". Knows those that choose what is computed. Throws ConfigError for any other.
[[nodiscard]] Sources sources_of(const std::vector<std::string>& words);
/// Chooses one run of a series.
void choose(const SeriesMember& member, Sources& sources);
/// Its varied values as a JSON object.
[[nodiscard]] nlohmann::ordered_json varied_json(const SeriesMember& member);
/// Refuses an experiment of a series that is a series itself. Throws ConfigError.
void refuse_nested(const Script& series, const Script& experiment);
/// True if a phase of the script asks a person.
[[nodiscard]] bool asks(const Script& script) noexcept;

/// The text of a prior.
/// @param learnt  keys below control. and their values
[[nodiscard]] std::string prior_text(const nlohmann::ordered_json& learnt, std::string_view model);

/// A value of the model that is not the plant's.
struct ModelDifference {
  std::string name;  ///< without prefix: "theta_N"
  double model{0.0};
  double plant{0.0};
};

/// Where the model differs from the simulated plant; nowhere on a rig, whose plant is unknown.
[[nodiscard]] std::vector<ModelDifference> model_differences(const Settings& settings);

/// "theta_N 23 (plant 40), c31_per_s 16 (plant 20.37)"; empty if no difference is visible in six digits.
[[nodiscard]] std::string in_words(const std::vector<ModelDifference>& differences);

/// Says where the true theta, or on a rig the model's, lies outside the bounds of the controller's estimate; empty:
/// nowhere. The estimate then stays at its bound.
[[nodiscard]] std::vector<std::string> theta_out_of_bounds(const Settings& settings);

/// Says if a wheel that still turns at the experiment's end speed can seem to stand: it then takes longer from count to
/// count than control.observer.standstill_time_s. Empty: it cannot.
[[nodiscard]] std::string standstill_too_early(const Settings& settings);

/// Says if the gate's cap of the brake's duty keeps the wheel from the wanted slip on the tyre of (10): below the peak
/// it must hold more torque than the capped brake gives. Empty: it does not, or no phase controls the slip that
/// control.slip_ref gives.
[[nodiscard]] std::string slip_out_of_reach(const Script& script, const Settings& settings);

/// Says where the brake's map (7) is negative at the end u0 of its dead zone, in the plant or, on a rig or where it
/// differs, in the model; empty: nowhere. The dead zone is then wider than u0 says.
[[nodiscard]] std::vector<std::string> negative_at_dead_zone(const Settings& settings);

}  // namespace abs_hil::config
