#pragma once

#include <cstdint>
#include <string_view>

namespace abs_hil::driver {

/// How well a fact about a board is known.
enum class Standing : std::uint8_t {
  documented,  ///< stated in the maker's own driver sources or manual
  inferred,    ///< concluded from these, but not stated there
  unknown,     ///< these sources are silent or disagree: the driver never relies on it
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
