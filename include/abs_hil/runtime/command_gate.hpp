#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "abs_hil/rig/command.hpp"
#include "abs_hil/rig/measurement.hpp"
#include "abs_hil/rig/reason.hpp"

namespace abs_hil::runtime {

/// Limits of what may reach the rig, whatever asks for it.
struct GateOptions {
  double motor_duty_max{1.0};     ///< in (0, 1]
  double brake_duty_max{1.0};     ///< in (0, 1]; the maker's driver caps the real brake at 0.7
  double overspeed_rad_s{250.0};  ///< either wheel above this latches a fault, > 0
  double supply_min_V{0.0};       ///< a board that reports less latches a fault, >= 0; 0: never
  /// A board that reports more latches a fault, deg C. Ours: the board's own limit is not public.
  double temperature_max_C{90.0};
};

/// What the gate did to a command.
enum class GateAction : std::uint8_t {
  passed = 0,
  motor_clamped,
  brake_clamped,
  motor_blocked_by_brake,    ///< motor and brake never act together: the brake wins
  motor_blocked_by_disable,  ///< motor duty without motor_enable
  refused,                   ///< the safe command went out instead; a fault is latched
};
inline constexpr std::size_t gate_action_count = 6;

struct GateResult {
  rig::Command command{};  ///< what may be sent
  GateAction action{GateAction::passed};
  rig::Reason fault{rig::Reason::none};  ///< the latched fault, once there is one
  double fault_value{0.0};
};

/// Stands between controller and driver and trusts neither: finite, then magnitude, then interlocks. A fault latches;
/// from then on only the safe command passes, until a new run makes a new gate. Real-time safe.
class CommandGate {
 public:
  explicit CommandGate(const GateOptions& options) noexcept : options_(options) {}

  /// @param speeds the speeds estimated from the latest measurement
  [[nodiscard]] GateResult check(const rig::Command& wanted, const rig::WheelSpeeds& speeds) noexcept;
  /// Latches what the board reports about itself: a trip of its own interlocks, supply, temperature. What it cannot
  /// tell (NaN) is no fault.
  void watch_board(const rig::Measurement& measurement) noexcept;
  /// Latches a fault found elsewhere (driver, executive). The first one stays.
  void latch(rig::Reason fault, double value) noexcept;

  [[nodiscard]] rig::Reason fault() const noexcept { return fault_; }
  [[nodiscard]] double fault_value() const noexcept { return fault_value_; }
  /// How often each action was taken.
  [[nodiscard]] std::uint64_t count(GateAction action) const noexcept {
    return counts_[static_cast<std::size_t>(action)];
  }

 private:
  GateOptions options_;
  rig::Reason fault_{rig::Reason::none};
  double fault_value_{0.0};
  std::array<std::uint64_t, gate_action_count> counts_{};
};

}  // namespace abs_hil::runtime
