#pragma once

#include "program/command_line.hpp"
#include "run/run.hpp"

namespace abs_hil::program {

/// True if a phase of the script asks a person.
[[nodiscard]] bool asks(const config::Script& script) noexcept;
/// Who answers the questions of a run, if experiment.answers is auto: "person" or "itself".
[[nodiscard]] const char* who_answers(const RunRequest& request);
/// Refuses a run whose questions nobody could answer, or that would move a rig without a person's answer. Throws
/// config::ConfigError.
void check_questions(const RunRequest& request);

/// Puts the questions of a run's phases to the terminal and hands Enter to the run. For the slow thread.
class Questions {
 public:
  /// @param run  must outlive it
  Questions(const RunRequest& request, run::Run& run);
  /// Call it every few milliseconds. Never waits.
  void poll();

 private:
  [[nodiscard]] bool entered();

  run::Run& run_;
  bool by_person_;
  bool commands_;
  bool terminal_;
  int asked_{-1};  ///< index of the phase whose question stands; -1: none
};

}  // namespace abs_hil::program
