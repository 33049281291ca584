// Facts about devices and processes in the kernel's files (sysfs, /proc).

#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

namespace abs_hil::driver {

/// First line of a file; empty if it cannot be read.
[[nodiscard]] inline std::string line_in(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  return line;
}

/// What stands behind the colon in the first line that begins with `key`, as in /proc/cpuinfo and /proc/self/status;
/// empty if there is no such line.
[[nodiscard]] inline std::string value_in(const std::filesystem::path& file, std::string_view key) {
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    const std::size_t colon = line.find(':');
    if (!line.starts_with(key) || colon == line.npos) continue;
    return line.substr(std::min(line.find_first_not_of(" \t", colon + 1), line.size()));
  }
  return {};
}

/// Name of a process; empty if unknown.
[[nodiscard]] inline std::string process_name(long pid) { return line_in("/proc/" + std::to_string(pid) + "/comm"); }

/// The number that a file begins with; 0 if it cannot be read. Base 16 allows "0x10b5" as well as "10b5".
[[nodiscard]] inline std::uint32_t number_in(const std::filesystem::path& file, int base) {
  return static_cast<std::uint32_t>(std::strtoul(line_in(file).c_str(), nullptr, base));
}

}  // namespace abs_hil::driver
