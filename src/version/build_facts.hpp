#pragma once

#include <string>

namespace abs_hil::version {

/// Facts about this program, fixed at build time.
struct BuildFacts {
  std::string version;
  std::string git_revision;  ///< of the sources; ends in "-dirty" if they had changes; "unknown" outside git
  std::string build_type;    ///< CMake's build type, as "Release"
  std::string compiler;
};
[[nodiscard]] BuildFacts build_facts();

/// What --version prints: "abs_hil 0.1.0 (88baa51f781b)", outside git without the commit.
[[nodiscard]] std::string version_line(const std::string& program);

}  // namespace abs_hil::version
