#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace abs_hil::run_folder {

/// What this program was built from, fixed when it was built.
struct BuildFacts {
  std::string version;
  std::string git_revision;  ///< of the sources; "-dirty" behind it if they had changes; "unknown" outside git
  std::string build_type;    ///< CMake's: "Release", say
  std::string compiler;
};
[[nodiscard]] BuildFacts build_facts();

/// What a run depended on beside its configuration.
struct RunEnvironment {
  std::vector<std::string> command_line;
  std::string backend;
  std::string board;                     ///< driver's name, as "pci"; "sim" for the simulator
  std::vector<std::string> board_notes;  ///< what the driver found out about its board
  bool emulated{false};                  ///< the board is an emulator
  bool virtual_time{false};              ///< --fast
  bool realtime{false};                  ///< every required step of the real-time set-up was obtained
  std::string realtime_shortcomings{};   ///< in words; empty if none
};

/// environment.json: the above, this computer (kernel, host, processors) and the date, UTC.
[[nodiscard]] nlohmann::ordered_json environment_json(const RunEnvironment& run);

}  // namespace abs_hil::run_folder
