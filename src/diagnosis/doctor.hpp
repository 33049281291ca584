#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "abs_hil/driver/backend.hpp"
#include "abs_hil/driver/rig_driver.hpp"
#include "driver/factory.hpp"
#include "runtime/realtime_setup.hpp"

namespace abs_hil::diagnosis {

using driver::Finding;
using Standing = Finding::Standing;

/// One line per finding, with detail and fix below it.
[[nodiscard]] std::string to_text(std::span<const Finding> findings);
[[nodiscard]] nlohmann::ordered_json to_json(std::span<const Finding> findings);
/// The worst standing of the findings; `good` if there are none.
[[nodiscard]] Standing worst(std::span<const Finding> findings) noexcept;

/// Findings of the check "boards": each board that a backend has found, and what keeps a run from using it. A missing
/// board is a note.
[[nodiscard]] std::vector<Finding> judge(std::string_view kind, const std::vector<driver::FoundBoard>& boards);

/// Names of the checks of `examine`, in its order: of the computer, of each backend that inspects what leads to its
/// board, "boards", "backend".
[[nodiscard]] std::vector<std::string> check_names();

/// Options of an examination.
struct Examination {
  std::string only{};  ///< one of check_names(), or empty for all
  std::string lcm_url{};
  runtime::RealtimeOptions realtime{};
  std::string backend{"sim"};
  double rate_Hz{1000.0};          ///< cycles per second, for what a bus must carry
  driver::DriverOptions driver{};  ///< where each backend looks for its boards
  /// Makes the driver of the backend. It may throw driver::Unavailable, and so may the driver's `configure`.
  std::function<std::unique_ptr<driver::RigDriver>()> make_driver{};
  /// Throws driver::Unavailable if the configured board needs a commissioning first. Empty: it needs none.
  std::function<void(const driver::RigDriver&)> require_commissioned{};
};

/// Examines this computer. It obtains real-time scheduling in a thread of its own to check that it is available; memory
/// stays locked. It configures the backend's driver, which moves nothing. Only the backend's check can fail.
[[nodiscard]] std::vector<Finding> examine(const Examination& examination);

/// The result of the examination. All checks: true if the backend can run. A single check: true if nothing in it needs
/// a fix.
[[nodiscard]] bool turned_out_well(const Examination& examination, std::span<const Finding> findings);

}  // namespace abs_hil::diagnosis
