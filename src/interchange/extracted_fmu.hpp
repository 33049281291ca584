#pragma once

#include <filesystem>

namespace abs_hil::interchange {

/// The parts of an FMU that its controller needs, in a folder of their own: description, resources, and the library for
/// this computer. The folder goes with this object. Nothing of the FMU runs.
class ExtractedFmu {
 public:
  /// Throws std::invalid_argument, which names the file, for a damaged archive, one with absurd sizes or with names
  /// that lead out of the folder, and one without a library for this computer.
  explicit ExtractedFmu(const std::filesystem::path& file);
  ExtractedFmu(const ExtractedFmu&) = delete;
  ExtractedFmu& operator=(const ExtractedFmu&) = delete;
  ~ExtractedFmu();

  [[nodiscard]] const std::filesystem::path& folder() const noexcept { return folder_; }

 private:
  std::filesystem::path folder_{};
};

}  // namespace abs_hil::interchange
