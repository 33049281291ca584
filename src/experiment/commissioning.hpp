#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "abs_hil/driver/rig_driver.hpp"
#include "runtime/clock.hpp"

namespace abs_hil::experiment {

/// The person at the rig.
class Dialog {
 public:
  Dialog() = default;
  Dialog(const Dialog&) = delete;
  Dialog& operator=(const Dialog&) = delete;
  virtual ~Dialog() = default;

  virtual void tell(const std::string& text) = 0;
  /// A yes-or-no question. Anything but a plain yes, the end of input included, is a no.
  [[nodiscard]] virtual bool ask(const std::string& question) = 0;
  /// Waits until the person has done what the text says. False at the end of input.
  [[nodiscard]] virtual bool wait_until_done(const std::string& text) = 0;
};

/// Who stands by while a pulse acts, should this program die or hang meanwhile.
class PulseGuard {
 public:
  PulseGuard() = default;
  PulseGuard(const PulseGuard&) = delete;
  PulseGuard& operator=(const PulseGuard&) = delete;
  virtual ~PulseGuard() = default;

  /// Before anything is driven. Throws driver::Unavailable: then there is no pulse.
  virtual void begin() = 0;
  /// Once a cycle of the pulse, before anything is written: a sign of life. False once nobody stands by any more.
  [[nodiscard]] virtual bool beat() noexcept = 0;
  /// Nothing is driven any more.
  /// @param safe  the outputs are known to be 0
  virtual void end(bool safe) noexcept = 0;
};

/// Pulses of the commissioning: small enough that nothing can run away.
struct CommissioningOptions {
  double drive_duty{0.15};       ///< in (0, 0.3]
  double drive_pulse_s{0.3};     ///< in (0, 1]
  double brake_duty{0.5};        ///< in (0, 0.7]; above the dead zone of 0.415, or nothing is felt
  double brake_pulse_s{0.3};     ///< in (0, 1]
  double run_out_limit_s{60.0};  ///< longest wait for the wheels to stand again, > 0
};

enum class CommissioningResult : std::uint8_t { passed, failed, declined, interrupted };

/// First steps with a rig, each asked for: read the board, turn the wheels by hand, a small drive pulse, a small brake
/// pulse, both beside a guard. The first step that does not turn out as it should ends it; the outputs are safe
/// whichever way it ends.
class Commissioning {
 public:
  /// Throws std::invalid_argument if an option is outside its range.
  /// @param stop_requested asked every cycle; true ends the pulse at once
  Commissioning(driver::RigDriver& driver, runtime::Clock& clock, Dialog& dialog, PulseGuard& guard,
                const CommissioningOptions& options, std::function<bool()> stop_requested);
  /// Throws driver::Unavailable if the board is not there or not as it should be.
  [[nodiscard]] CommissioningResult run();

 private:
  enum class Wheel : std::uint8_t { upper, lower };
  struct Travel {
    std::int32_t upper{0};
    std::int32_t lower{0};
  };

  [[nodiscard]] CommissioningResult read_board();
  [[nodiscard]] CommissioningResult turn_by_hand();
  [[nodiscard]] CommissioningResult drive_pulse();
  [[nodiscard]] CommissioningResult brake_pulse();
  [[nodiscard]] bool judge_turn(Wheel wheel, const Travel& travel);
  [[nodiscard]] bool read(rig::Measurement& measurement);
  [[nodiscard]] bool pulse(const rig::Command& command, double duration_s, Travel& travel);
  [[nodiscard]] bool drive(const rig::Command& command, std::int64_t end_ns);
  [[nodiscard]] bool wait_for_standstill();
  [[nodiscard]] CommissioningResult unless_stopped(CommissioningResult result) const;

  driver::RigDriver& driver_;
  runtime::Clock& clock_;
  Dialog& dialog_;
  PulseGuard& guard_;
  CommissioningOptions options_;
  std::function<bool()> stop_requested_;
};

}  // namespace abs_hil::experiment
