#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "abs_hil/rig/command.hpp"
#include "abs_hil/rig/measurement.hpp"
#include "abs_hil/rig/phase.hpp"
#include "abs_hil/rig/time_units.hpp"
#include "rig/gate_counts.hpp"
#include "runtime/encoder_check.hpp"
#include "runtime/gate_options.hpp"
#include "runtime/plausibility_limits.hpp"
#include "runtime/response_check.hpp"
#include "runtime/run_latch.hpp"
#include "runtime/speed_window.hpp"

namespace abs_hil::runtime {

using rig::gate_action_count;
using rig::GateAction;

/// A driver may round a duty down by so much: half a step of 8 bits, the coarsest PWM.
inline constexpr double rounded_down_most = 0.5 / 255.0;

/// Tolerance for rounding: a step exactly at the limit must pass.
inline constexpr double rise_rounding = 1e-9;

/// The largest duties that the driver can send.
struct SendableDuties {
  double motor{1.0};
  double brake{1.0};
};

/// Inputs of the gate besides the command.
struct GateInput {
  rig::WheelSpeeds speeds{};  ///< estimated from the latest measurement
  rig::Phase phase{rig::Phase::idle};
  std::int64_t now_ns{0};  ///< the cycle's wake-up
};

struct GateResult {
  rig::Command command{};                 ///< the command that may be sent
  GateAction action{GateAction::passed};  ///< the last action taken on it
};

/// Safety gate between controller and driver. It checks each command for finite values, range, rate and interlocks. It
/// checks that each measurement agrees with physics and with the commands sent; checks that cannot judge for long are a
/// fault, too. It is the run's latch: after a fault, its own or one latched here, only the safe command passes. Each
/// run has a new gate. docs/safety.md lists every check with its reason. Real-time safe.
class CommandGate : public RunLatch {
 public:
  /// @param permissions which actuators each phase allows
  /// @param limits      bounds for the plausibility checks; not `enabled`: the wheels are not checked
  /// @param brake_free_duty  brake duty that gives no torque, u0 of (7): a rise of torque begins there
  /// @param sendable  what passes at most, so that no rounding exceeds the limits; to lower a duty to it is no
  ///   intervention
  explicit CommandGate(const GateOptions& options, const PhasePermissions& permissions = any_phase(),
                       const PlausibilityLimits& limits = {}, double brake_free_duty = 0.0,
                       const SendableDuties& sendable = {})
      : options_(options),
        sendable_(sendable),
        judge_within_ns_(static_cast<std::int64_t>(options.judge_within_s * static_cast<double>(rig::ns_per_s))),
        permissions_(permissions),
        brake_free_duty_(brake_free_duty),
        checks_wheels_(limits.enabled),
        speed_windows_(limits),
        encoders_(limits),
        response_(limits) {}

  /// Checks a cycle's measurement before anything uses it. Latches faults that the board reports and wheel motion that
  /// is physically impossible.
  /// @return false if the measurement must not be used, because it is stale or a counter jumped; use the one before
  /// @param reading_ns duration of the reading, which began at `now_ns`: the counters were latched within it
  bool check_measurement(const rig::Measurement& measurement, std::int64_t now_ns,
                         std::int64_t reading_ns = 0) noexcept;
  /// False while the checks of the wheels doubt the readings, or a verdict is due. True if the gate does not check
  /// them.
  [[nodiscard]] bool wheels_sound() const noexcept {
    return !checks_wheels_ || (!speed_windows_.overdue() && !encoders_.doubtful());
  }
  [[nodiscard]] GateResult check(const rig::Command& wanted, const GateInput& input) noexcept;
  /// Tells what the driver made of the command of the last `check`. Until then the gate takes the command itself as
  /// sent.
  void note_sent(const rig::Command& sent) noexcept;
  /// Tells that the wheels are apart from now on, or touch again. Checks that compare the wheels rest while they are.
  void note_wheels_apart(bool apart) noexcept {
    encoders_.note_wheels_apart(apart);
    response_.note_wheels_apart(apart);
  }
  /// How often each action was taken; any thread may call it.
  [[nodiscard]] rig::GateCounts counts() const noexcept;
  /// Share of the run's time in which a verdict of the wheels' checks was due and could not be given; 0 if the gate
  /// does not check the wheels. Any thread may call it.
  [[nodiscard]] double unjudged_share() const noexcept;
  [[nodiscard]] std::uint64_t count(GateAction action) const noexcept {
    return counts_[static_cast<std::size_t>(action)].load(std::memory_order_relaxed);
  }

 private:
  void check_board(const rig::Measurement& measurement) noexcept;
  void check_wheels(const rig::Measurement& measurement, std::int64_t now_ns, std::int64_t reading_ns) noexcept;
  /// Latches a fault when the checks of the wheels have given no verdict for `judge_within_s` while an output was on.
  void require_verdict(std::int64_t now_ns) noexcept;
  void require_finite(const rig::Command& wanted, const rig::WheelSpeeds& speeds) noexcept;
  [[nodiscard]] double limited(double duty, double most, double sendable, GateAction action) noexcept;
  [[nodiscard]] double rising(double duty, double before, double rate_per_s, double elapsed_s,
                              GateAction action) noexcept;
  [[nodiscard]] rig::Command after_fault(const rig::Command& wanted, std::int64_t now_ns) noexcept;
  void interlock(rig::Command& command, const PhasePermission& may) noexcept;
  void note(GateAction action) noexcept;

  GateOptions options_;
  SendableDuties sendable_;
  std::int64_t judge_within_ns_;
  PhasePermissions permissions_;
  double brake_free_duty_;
  bool checks_wheels_;
  SpeedWindows speed_windows_;
  EncoderCheck encoders_;
  ResponseCheck response_;
  rig::Command sent_{};
  double motor_risen_{0.0};  ///< duties from which the next rise counts
  double brake_risen_{0.0};
  bool has_sent_{false};
  std::int64_t sent_ns_{0};
  std::int64_t watched_until_ns_{-1};         ///< < 0: the wheels have not been checked yet
  std::int64_t without_verdict_ns_{0};        ///< with an output on, since the latest verdict
  std::atomic<std::int64_t> watched_ns_{0};   ///< only the cycle's thread writes these two
  std::atomic<std::int64_t> unjudged_ns_{0};  ///< the part of it in which a verdict was overdue
  bool supply_known_{false};
  bool temperature_known_{false};
  GateAction last_action_{GateAction::passed};
  std::int64_t fault_ns_{-1};  ///< the first command after the fault; < 0: none yet
  std::array<std::atomic<std::uint64_t>, gate_action_count> counts_{};  ///< only the cycle's thread adds
};

}  // namespace abs_hil::runtime
