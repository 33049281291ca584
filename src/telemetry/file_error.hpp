#pragma once

#include <filesystem>
#include <stdexcept>
#include <string_view>

namespace abs_hil::telemetry {

/// A file could not be opened or written. `what()` names the path, the reason and the fix.
class FileError : public std::runtime_error {
 public:
  /// `kind` is the kind of file, as in "CSV file". `error_number` is an errno.
  FileError(std::string_view kind, const std::filesystem::path& path, int error_number);

  [[nodiscard]] int error_number() const noexcept { return error_number_; }

 private:
  int error_number_;
};

}  // namespace abs_hil::telemetry
