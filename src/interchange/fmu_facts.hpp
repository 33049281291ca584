#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

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
  ExtractedFmu();  ///< an empty folder

  std::filesystem::path folder_{};
};

/// A variable of an FMU that carries one of our quantities, or a parameter with its value.
struct FmuLink {
  std::uint32_t reference{0};
  std::size_t offset{0};
  double value{0.0};  ///< of a parameter
};

/// What a controller's FMU is, and how its variables belong to ours.
struct FmuFacts {
  int fmi{2};
  std::string token{};  ///< guid, or instantiation token
  std::filesystem::path library{};
  std::vector<FmuLink> inputs{};
  std::vector<FmuLink> outputs{};
  std::vector<FmuLink> parameters{};  ///< real ones
  std::vector<FmuLink> flags{};       ///< Boolean ones
  std::vector<FmuLink> integers{};
};

/// Reads the description in an extracted FMU, and the mapping if there is one.
/// Throws std::invalid_argument, which names `file`, the FMU as typed.
[[nodiscard]] FmuFacts facts_of(const std::filesystem::path& file, const std::filesystem::path& folder,
                                const std::filesystem::path& mapping);

}  // namespace abs_hil::interchange
