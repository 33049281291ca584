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

}  // namespace abs_hil::config
