#pragma once

#include <filesystem>
#include <fstream>
#include <string>

namespace abs_hil::diagnosis {

/// First line of a small file, such as those in /sys, without trailing blanks; `otherwise` if it is empty or cannot be
/// read.
[[nodiscard]] inline std::string first_line(const std::filesystem::path& file, const std::string& otherwise = {}) {
  std::ifstream stream(file);
  std::string line;
  std::getline(stream, line);
  line.erase(line.find_last_not_of(" \t\r\n") + 1);
  return line.empty() ? otherwise : line;
}

}  // namespace abs_hil::diagnosis
