#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>

namespace abs_hil::diagnosis {

/// Severity of a finding. A note needs no action, a warning costs quality, and after a failure the backend cannot run.
enum class Standing : std::uint8_t { good, note, warning, failure };

/// The result of examining one item of this computer.
struct Finding {
  std::string check;  ///< name of its check, as in `abs_hil doctor --only CHECK`
  std::string what;   ///< the item, as "SCHED_FIFO priority 80"
  Standing standing{Standing::good};
  std::string detail{};  ///< the observation
  std::string fix{};     ///< commands or advice, one per line; empty if no action is needed
};

/// One line per finding, with detail and fix below it.
[[nodiscard]] std::string to_text(std::span<const Finding> findings);
[[nodiscard]] nlohmann::ordered_json to_json(std::span<const Finding> findings);
/// The worst standing of the findings; `good` if there are none.
[[nodiscard]] Standing worst(std::span<const Finding> findings) noexcept;

}  // namespace abs_hil::diagnosis
