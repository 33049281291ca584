#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>

namespace abs_hil::diagnosis {

/// How a finding stands: a note needs nothing, a warning costs quality, with a failure the backend cannot run.
enum class Standing : std::uint8_t { good, note, warning, failure };

/// One thing that was looked at on this computer.
struct Finding {
  std::string check;  ///< the check it belongs to, as in `abs_hil doctor --only CHECK`
  std::string what;   ///< "SCHED_FIFO priority 80", say
  Standing standing{Standing::good};
  std::string detail{};  ///< what was observed
  std::string fix{};     ///< commands or advice that mend it, one a line; empty if nothing is to be done
};

[[nodiscard]] std::string_view name_of(Standing standing) noexcept;
/// One line each, the detail and the fix below.
[[nodiscard]] std::string to_text(std::span<const Finding> findings);
[[nodiscard]] nlohmann::ordered_json to_json(std::span<const Finding> findings);
/// The worst standing among them; `good` for none.
[[nodiscard]] Standing worst(std::span<const Finding> findings) noexcept;

}  // namespace abs_hil::diagnosis
