// Who answers the questions of a run's phases.
#pragma once

#include "program/command_line.hpp"

namespace abs_hil::program {

/// Values of experiment.answers.
inline constexpr const char* answers_person = "person";
inline constexpr const char* answers_itself = "itself";

/// True if the run takes commands over LCM.
[[nodiscard]] bool hears_commands(const RunRequest& request);
/// True if stdin is a terminal.
[[nodiscard]] bool at_terminal() noexcept;
/// True if a phase of the script asks a person.
[[nodiscard]] bool asks(const config::Script& script) noexcept;
/// Who answers the questions of a run, if experiment.answers is auto: "person" or "itself".
[[nodiscard]] const char* who_answers(const RunRequest& request);
/// Refuses a run whose questions nobody could answer, or that would move a rig without a person's answer. Throws
/// config::ConfigError.
void check_questions(const RunRequest& request);

}  // namespace abs_hil::program
