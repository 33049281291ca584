#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <variant>
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

enum class IntFlag : int {};  ///< a Boolean of FMI 2

/// A numeric type of FMI.
struct FmuType {
  std::string_view name;       ///< as the description has it
  std::string_view functions;  ///< that set and get it: fmi3SetInt64 for an Enumeration of FMI 3
  std::variant<double, float, std::int8_t, std::uint8_t, std::int16_t, std::uint16_t, std::int32_t, std::uint32_t,
               std::int64_t, std::uint64_t, bool, IntFlag>
      zero;
};

/// A variable of an FMU that carries one of our quantities, or a parameter with its value.
struct FmuLink {
  std::uint32_t reference{0};
  std::size_t offset{0};  ///< of the quantity in abs_hil_input or abs_hil_output
  double wanted{0.0};     ///< of a parameter
  FmuType type{};
};

/// What a controller's FMU is, and how its variables belong to ours.
struct FmuFacts {
  int fmi{2};
  std::string token{};  ///< guid, or instantiation token
  std::filesystem::path library{};
  std::vector<FmuLink> inputs{};
  std::vector<FmuLink> outputs{};
  std::vector<FmuLink> parameters{};
};

/// Reads the description in an extracted FMU, and the mapping if there is one.
/// Throws std::invalid_argument, which names `file`, the FMU as typed.
[[nodiscard]] FmuFacts facts_of(const std::filesystem::path& file, const std::filesystem::path& folder,
                                const std::filesystem::path& mapping);

}  // namespace abs_hil::interchange
