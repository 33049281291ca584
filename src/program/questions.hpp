#pragma once

#include "program/command_line.hpp"
#include "run/run.hpp"

namespace abs_hil::program {

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
