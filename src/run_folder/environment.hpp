#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace abs_hil::run_folder {

/// Facts about this program, fixed at build time.
struct BuildFacts {
  std::string version;
  std::string git_revision;  ///< of the sources; ends in "-dirty" if they had changes; "unknown" outside git
  std::string build_type;    ///< CMake's build type, as "Release"
  std::string compiler;
};
[[nodiscard]] BuildFacts build_facts();

/// What a run depended on besides its configuration.
struct RunEnvironment {
  std::vector<std::string> command_line;
  std::string backend;
  std::string board;                     ///< name of the driver, as "pci"; "sim" for the simulator
  std::vector<std::string> board_notes;  ///< what the driver reports about its board
  bool emulated{false};                  ///< the board is an emulator
  bool virtual_time{false};              ///< --fast
  bool realtime{false};                  ///< every required step of the real-time set-up was obtained
  std::string realtime_shortcomings{};   ///< as text; empty if none
};

/// Content of environment.json: the facts above, this computer (kernel, host, processors) and the date in UTC.
[[nodiscard]] nlohmann::ordered_json environment_json(const RunEnvironment& run);

}  // namespace abs_hil::run_folder
