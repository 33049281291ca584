#pragma once

#include <cstddef>
#include <filesystem>
#include <stdexcept>
#include <string>

namespace abs_hil::run_folder {

/// A run's file that cannot be read. The message gives the file, the line if known, the problem and the fix.
class InputError : public std::runtime_error {
 public:
  explicit InputError(const std::string& message) : std::runtime_error(message) {}
  InputError(const std::filesystem::path& file, std::size_t line, const std::string& message)
      : std::runtime_error(file.string() + ":" + std::to_string(line) + ": " + message) {}
};

}  // namespace abs_hil::run_folder
