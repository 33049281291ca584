#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace abs_hil::interchange {

/// The symbols that a shared library defines, read from the file. No code of the library runs.
class ElfLibrary {
 public:
  /// Throws std::invalid_argument, which names the file, if it cannot be read, is not a shared library of this
  /// computer's kind, or is damaged.
  explicit ElfLibrary(const std::filesystem::path& file);

  [[nodiscard]] bool has_function(std::string_view name) const;
  [[nodiscard]] bool has_object(std::string_view name) const;
  /// The initial bytes of a defined object; empty if the library has none of that name, or none with bytes in the file.
  [[nodiscard]] std::span<const std::uint8_t> object(std::string_view name) const;

 private:
  struct Symbol {
    bool function{false};
    std::uint64_t offset{0};
    std::uint64_t size{0};
  };
  std::vector<std::uint8_t> bytes_{};
  std::map<std::string, Symbol, std::less<>> symbols_{};
};

}  // namespace abs_hil::interchange
