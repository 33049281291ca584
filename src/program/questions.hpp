// Questions of an experiment's phases to a person at the terminal.
#pragma once

#include "program/command_line.hpp"
#include "run/run.hpp"

namespace abs_hil::program {

/// True if the run takes commands over LCM.
[[nodiscard]] bool hears_commands(const RunRequest& request);
/// True if stdin is a terminal.
[[nodiscard]] bool at_terminal() noexcept;
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
