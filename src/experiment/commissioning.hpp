#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "abs_hil/driver/rig_driver.hpp"
#include "experiment/board_record.hpp"
#include "runtime/clock.hpp"

namespace abs_hil::experiment {

/// A person's answer. None: the input has ended, or a signal came.
enum class Answer : std::uint8_t { yes, no, none };

/// The dialog with the person at the rig.
class Dialog {
 public:
  virtual ~Dialog() = default;

  virtual void tell(const std::string& text) = 0;
  /// Asks a yes-or-no question. Every line but a plain yes counts as no.
  [[nodiscard]] virtual Answer ask(const std::string& question) = 0;
  /// Waits until the person has done what the text says, and meanwhile calls `watch` every 50 ms. Returns false if
  /// `watch` does, at the end of input and at a signal.
  [[nodiscard]] virtual bool wait_until_done(const std::string& text, const std::function<bool()>& watch) = 0;
};

/// A guard that makes the outputs safe if this program dies or hangs during a pulse.
class PulseGuard {
 public:
  virtual ~PulseGuard() = default;

  /// Called before the driver opens the board. Throws driver::Unavailable: then it stays closed.
  virtual void take_board() {}
  /// Called before the pulse. Throws driver::Unavailable: then there is no pulse.
  virtual void begin() = 0;
  /// Called in each cycle of the pulse before the write: a heartbeat. Returns false once the guard has ended.
  [[nodiscard]] virtual bool beat() noexcept = 0;
  /// Called after the pulse.
  /// @param safe  the outputs are known to be 0
  virtual void end(bool safe) noexcept = 0;
};

/// Pulses of the commissioning; their limits keep the rig from running away.
struct CommissioningOptions {
  double drive_duty{0.15};                    ///< in (0, 0.3]
  double brake_duty{0.5};                     ///< in (0, 0.7]; the brake grips above its dead zone of 0.415
  std::int32_t encoder_counts_per_rev{4096};  ///< model.encoder_counts_per_rev, > 0: what one turn must give
  bool emulated{false};                       ///< the board is an emulator's: its brake can be neither seen nor heard
};

enum class CommissioningResult : std::uint8_t { passed, failed, declined, interrupted };

/// What the wheels have moved by from one measurement to the other.
[[nodiscard]] WheelCounts travel_between(const rig::Measurement& before, const rig::Measurement& after) noexcept;

/// An error as a run names it: the backend's own reason, if it has one, and the error.
[[nodiscard]] std::string reason_and_error(const driver::IoResult& result);

/// The first steps with a rig. Each needs the person's consent: read the board, turn the wheels by hand, a small drive
/// pulse, the cable pulled if the board watches it, a small brake pulse. A guard stands by whenever an output is on.
/// The first step that fails ends the commissioning. The outputs are safe however it ends.
class Commissioning {
 public:
  /// Throws std::invalid_argument if an option is outside its range.
  /// @param stop_requested called every cycle; true ends the pulse at once
  Commissioning(driver::RigDriver& driver, runtime::Clock& clock, Dialog& dialog, PulseGuard& guard,
                const CommissioningOptions& options, std::function<bool()> stop_requested);
  /// Throws driver::Unavailable if the board is absent or not as expected.
  [[nodiscard]] CommissioningResult run();
  /// What the last step has measured.
  [[nodiscard]] const OutputTimes& output_times() const noexcept { return output_times_; }
  /// What turning by hand has given.
  [[nodiscard]] const WheelCounts& one_turn() const noexcept { return one_turn_; }

 private:
  static constexpr std::int64_t cycle_ns = 1'000'000;
  static constexpr double pulse_s = 0.3;
  static constexpr double silence_s = 0.3;         ///< how long the program then sends nothing, the brake on
  static constexpr double run_out_limit_s = 60.0;  ///< longest wait for standstill
  /// Largest movement of a wheel that nobody touches and nothing drives.
  static constexpr std::int32_t still_counts = 64;

  enum class Wheel : std::uint8_t { upper, lower };

  [[nodiscard]] CommissioningResult read_board();
  [[nodiscard]] CommissioningResult turn_by_hand();
  [[nodiscard]] CommissioningResult drive_pulse();
  /// Of a board that drops its outputs without its cable: the drive is on while a person pulls it. Shows the outputs'
  /// polarity too, because then the pins are pulled high.
  [[nodiscard]] CommissioningResult pull_cable();
  [[nodiscard]] CommissioningResult brake_pulse();
  [[nodiscard]] bool judge_turn(Wheel wheel, const WheelCounts& travel);
  /// Asks for consent to a step.
  [[nodiscard]] bool agrees(const std::string& question) { return dialog_.ask(question) == Answer::yes; }
  /// Asks what only a person can see; tells the fix if it was not seen.
  [[nodiscard]] CommissioningResult is_seen(const std::string& question, const char* fix);
  [[nodiscard]] bool read(rig::Measurement& measurement);
  /// The same for a decision: not a measurement from before this call, which a driver repeats when an answer is lost.
  [[nodiscard]] bool read_fresh(rig::Measurement& measurement);
  [[nodiscard]] bool pulse(const rig::Command& command, WheelCounts& travel);
  [[nodiscard]] bool drive(const rig::Command& command, std::int64_t end_ns);
  /// Drives until the board is silent; `before` are then the speeds of the wheels, counts/s.
  [[nodiscard]] bool drive_until_silent(WheelCounts& before);
  [[nodiscard]] bool await_board();
  [[nodiscard]] bool counts_in_0_1_s(WheelCounts& travel);
  [[nodiscard]] bool activate_and_rest();
  [[nodiscard]] std::string step(int number) const;
  [[nodiscard]] bool wait_for_standstill();
  /// Falls silent with the brake on and sees what the board does by itself; then measures how soon it is safe.
  [[nodiscard]] bool measure_outputs();
  void watch_silence();

  driver::RigDriver& driver_;
  runtime::Clock& clock_;
  Dialog& dialog_;
  PulseGuard& guard_;
  CommissioningOptions options_;
  std::function<bool()> stop_requested_;
  OutputTimes output_times_{};
  WheelCounts one_turn_{};
};

}  // namespace abs_hil::experiment
