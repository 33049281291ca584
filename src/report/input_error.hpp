#pragma once

#include <cstddef>
#include <filesystem>
#include <stdexcept>
#include <string>

namespace abs_hil::report {

/// A run that cannot be read. The message names file, line where there is one, what is wrong, and the fix.
class InputError : public std::runtime_error {
 public:
  explicit InputError(const std::string& message) : std::runtime_error(message) {}
  InputError(const std::filesystem::path& file, std::size_t line, const std::string& message)
      : std::runtime_error(file.string() + ":" + std::to_string(line) + ": " + message) {}
};

/// Something that a report needs and this machine does not have, gnuplot say. The message names the fix.
class UnavailableError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace abs_hil::report
