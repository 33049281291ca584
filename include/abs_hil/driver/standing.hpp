#pragma once

#include <cstdint>
#include <string_view>

namespace abs_hil::driver {

/// How well a fact about a board is known.
enum class Standing : std::uint8_t {
  documented,  ///< read in the maker's own driver sources or manual
  inferred,    ///< concluded from them, not said there
  unknown,     ///< sources are silent or disagree: never relied on
};
[[nodiscard]] constexpr std::string_view name_of(Standing standing) noexcept {
  switch (standing) {
    case Standing::documented: return "documented";
    case Standing::inferred: return "inferred";
    case Standing::unknown: return "unknown";
  }
  return "unknown";
}

}  // namespace abs_hil::driver
