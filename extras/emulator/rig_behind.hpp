// The simulated rig behind a board, the same for every board, the log of a board's outputs, and its faults as text:
// "NAME" or "NAME=NUMBER".
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abs_hil/plant_sim/plant.hpp"
#include "plant_sim/encoder.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::emulator {

/// Throws the error of every emulator for an unknown fault.
[[noreturn]] inline void refuse_fault(std::string_view text, std::string_view valid) {
  throw std::invalid_argument("fault \"" + std::string(text) + "\": give " + std::string(valid));
}

/// A fault by its name, which "=WHAT" follows if it takes a number.
struct FaultName {
  std::string_view usage;
  double least{0.0};
  double most{0.0};
  bool whole{false};  ///< the number is an integer

  [[nodiscard]] std::string_view name() const { return usage.substr(0, usage.find('=')); }
  [[nodiscard]] bool takes_number() const { return usage.find('=') != std::string_view::npos; }
};

/// A fault as a user gave it: its place in the table of names, and its number, 0 if it takes none.
struct GivenFault {
  std::size_t place{0};
  double number{0.0};
};
/// The fault of the table that `text` names. Throws std::invalid_argument with `whole`, the text as the user gave it,
/// `valid`, and the table.
[[nodiscard]] inline GivenFault fault_in(std::string_view text, std::span<const FaultName> names,
                                         std::string_view whole, std::string_view valid, std::string_view between) {
  const std::size_t equals = text.find('=');
  for (std::size_t place = 0; place < names.size(); ++place) {
    const FaultName& name = names[place];
    if (name.name() != text.substr(0, equals) || name.takes_number() != (equals != std::string_view::npos)) continue;
    if (!name.takes_number()) return {place};
    const std::string_view digits = text.substr(equals + 1);
    const auto number = rig::parse_number<double>(digits);
    const bool fits = number && *number >= name.least && *number <= name.most;
    if (fits && (!name.whole || rig::parse_number<unsigned>(digits))) return {place, *number};
  }
  std::string all;
  for (const FaultName& name : names) all.append(all.empty() ? "" : between).append(name.usage);
  refuse_fault(whole, std::string(valid) + all);
}
[[nodiscard]] inline GivenFault fault_in(std::string_view text, std::span<const FaultName> names) {
  return fault_in(text, names, text, "one of ", " ");
}

/// Words of a board's description by their addresses.
using Hm2Words = std::vector<std::pair<std::uint16_t, std::uint32_t>>;

/// Properties of the emulated boards, their limits and their wiring to the rig. Where the makers' sources give no
/// value, this project chose the default ("our choice"). Where they are silent or disagree, an option selects the
/// variant, so that tests cover both.
struct BoardOptions {
  plant_sim::PlantOptions plant{};
  double start_speed_rad_s{0.0};  ///< both wheels' speed at power-on, >= 0
  bool lock_step{false};          ///< only the host advances the time
  // Of the card and the CAN node: our choice.
  double supply_V{24.0};  ///< 0 = no supply
  double supply_min_V{15.0};
  double temperature_C{30.0};
  std::uint32_t temperature_max_C{90};
  double overspeed_rpm{2200.0};  ///< in the vendor's demo the lower wheel reaches 1700
  // Of the card.
  std::uint32_t bitstream_version{0xAB5};  ///< our choice: the real word is not public
  std::uint32_t overspeed_bit{0};          ///< bit 0 or 2 of the trip flags; temperature has the other one
  bool trip_clears_width{false};           ///< a trip zeroes the width registers as well as the outputs
  // Of the USB board.
  std::uint16_t version{103};  ///< our choice: the real word is not public
  std::uint32_t drive_pwm{0};  ///< PWM channel wired to the drive, 0 ... 9
  std::uint32_t brake_pwm{1};
  std::uint32_t lower_encoder{0};  ///< encoder channel of the lower wheel, 0 ... 7
  std::uint32_t upper_encoder{1};
  bool shows_outputs{true};  ///< frames show the PWM and digital words that were sent; not known of the real board
  /// What enables the drive, -1: nothing: a digital line of the USB board, 0 ... 14, or an I/O of the 7I92T with the
  /// stage's active level, 0 ... 33.
  std::int32_t enable_line{-1};
  // Of the CAN node.
  std::uint16_t watchdog_ms{20};  ///< until an activation sets another value
  bool can_fd{true};              ///< answers a SYNC in an FD frame with an FD frame
  // Of the 7I92T and the node.
  std::string name{"7I92T"};  ///< 1 to 16 characters
  std::array<std::uint8_t, 6> mac{0x00, 0x60, 0x1B, 0x16, 0xAB, 0x50};
  std::array<std::uint8_t, 4> address{192, 168, 1, 121};  ///< as EEPROM and mesaflash show it
  bool active_high_stage{false};  ///< the power stages act while their pins are high: full PWM after a bite
  Hm2Words words{};               ///< in place of those of its description: another firmware, or an impossible one
};

/// Duties that reach the power stage, after mode, width, interlocks and E-stop. No cap applies here.
struct Outputs {
  double drive_duty{0.0};
  double brake_duty{0.0};
};

/// An event for a board's log.
struct BoardEvent {
  std::int64_t time_ns{0};  ///< the board's own clock, 0 at power-on
  std::string text{};
};
/// A change of the duties at the power stages.
struct OutputChange {
  std::int64_t time_ns{0};  ///< the board's time
  Outputs now{};
};

/// The log of a board's outputs in the board's own time.
class OutputLog {
 public:
  /// @param reload  what keeps the watchdog from acting
  explicit OutputLog(const char* reload = "watchdog last reloaded") : reload_(reload) {}

  void add(std::int64_t time_ns, const std::string& event) { events_.push_back({time_ns, event}); }
  /// Notes the duties if they have changed. `last_reload_ns`: when the watchdog was last reloaded, -1: never.
  void note(std::int64_t time_ns, const Outputs& now, const std::string& why, std::int64_t last_reload_ns) {
    const Outputs before = std::exchange(told_, now);
    if (now.drive_duty == before.drive_duty && now.brake_duty == before.brake_duty) return;
    changes_.push_back({time_ns, now});
    const auto zero = [](const Outputs& out) { return out.drive_duty == 0.0 && out.brake_duty == 0.0; };
    if (zero(now)) {
      const double since_ms = static_cast<double>(time_ns - last_reload_ns) * 1e-6;
      add(time_ns,
          "outputs zero: " + why + (last_reload_ns < 0 ? "" : rig::formatted("; %s %.3f ms ago", reload_, since_ms)));
    } else if (zero(before)) {
      add(time_ns, "outputs on: " + why);
    }
  }
  [[nodiscard]] std::vector<BoardEvent> take_events() { return std::exchange(events_, {}); }
  [[nodiscard]] std::vector<OutputChange> take_changes() { return std::exchange(changes_, {}); }

 private:
  const char* reload_;
  Outputs told_{};
  std::vector<BoardEvent> events_{};
  std::vector<OutputChange> changes_{};
};

/// A slower wheel counts as stopped: it moves less than one encoder line in the card's velocity period.
inline constexpr double standstill_rad_s = 0.5;

/// Converts revolutions per minute to rad/s.
[[nodiscard]] inline double rad_s_of_rpm(double rpm) noexcept {
  constexpr double seconds_per_minute = 60.0;
  return rpm * 2.0 * std::numbers::pi / seconds_per_minute;
}

/// Wheels, encoders, time and E-stop. A board derives from it and gives its outputs.
class RigBehind {
 public:
  static constexpr std::int64_t step_ns = 100'000;  ///< the plant and the board's interlocks run at 10 kHz

  /// Both wheels start at the same speed. Throws std::invalid_argument unless it is finite and >= 0.
  explicit RigBehind(const BoardOptions& options)
      : options_(options),
        plant_(options.plant),
        upper_(plant_sim::upper_encoder(options.plant)),
        lower_(plant_sim::lower_encoder(options.plant)) {
    const double start_speed_rad_s = options.start_speed_rad_s;
    if (!(start_speed_rad_s >= 0.0) || !std::isfinite(start_speed_rad_s)) {
      throw std::invalid_argument("start speed " + std::to_string(start_speed_rad_s) +
                                  " rad/s: give a finite value >= 0");
    }
    plant_.reset({.omega1_rad_s = start_speed_rad_s, .omega2_rad_s = start_speed_rad_s});
  }
  virtual ~RigBehind() = default;

  /// Duties that now reach the power stage.
  [[nodiscard]] virtual Outputs outputs() const noexcept = 0;
  /// The computer has paused the emulator for so long. A board lives on meanwhile, and so does the program that feeds
  /// its watchdog, which the pause has kept from it: the watchdog does not count this time.
  virtual void stood_still(std::int64_t /*duration_ns*/) {}
  /// Advances the rig to `time_ns` (0 at power-on); an earlier time does nothing. Steps end on multiples of `step_ns`,
  /// independent of the times of the host's accesses.
  void advance_to(std::int64_t time_ns) {
    while (time_ns_ < time_ns) {
      const std::int64_t from_ns = time_ns_;
      const plant_sim::PlantState before = plant_.state();
      const std::int64_t next_ns = step_end_ns(std::min(time_ns, (from_ns / step_ns + 1) * step_ns));
      const Outputs out = outputs();
      plant_.advance(static_cast<double>(next_ns - from_ns) * 1e-9,
                     {.motor_duty = out.drive_duty, .brake_duty = out.brake_duty});
      time_ns_ = next_ns;
      after_step(before, from_ns);
    }
  }

  // Events from outside the rig, except those of the host.
  virtual void press_emergency_stop(bool pressed) { emergency_stop_ = pressed; }  ///< cuts the drive only
  void set_supply_V(double volts) noexcept { options_.supply_V = volts; }
  void set_temperature_C(double celsius) noexcept { options_.temperature_C = celsius; }
  virtual void trip_overspeed() noexcept { overspeed_latched_ = true; }
  /// Turns a standing wheel by hand.
  virtual void turn_by_hand(bool upper_wheel, double revolutions) {
    plant_sim::PlantState state = plant_.state();
    (upper_wheel ? state.angle1_rad : state.angle2_rad) += revolutions * 2.0 * std::numbers::pi;
    plant_.reset(state);
  }

  [[nodiscard]] std::int64_t time_ns() const noexcept { return time_ns_; }
  /// True speeds and torques for the emulator's own log; the board does not show them.
  [[nodiscard]] const plant_sim::Plant& plant() const noexcept { return plant_; }
  [[nodiscard]] OutputLog& log() noexcept { return log_; }

 protected:
  RigBehind(const RigBehind&) = default;
  RigBehind& operator=(const RigBehind&) = default;

  /// The end of the step that begins now: `next_ns`, or an earlier time at which the board itself acts.
  [[nodiscard]] virtual std::int64_t step_end_ns(std::int64_t next_ns) const noexcept { return next_ns; }
  /// What the board does after each step: interlocks, watchdog.
  /// @param before   the rig at the beginning of the step, at `from_ns`
  virtual void after_step(const plant_sim::PlantState& /*before*/, std::int64_t /*from_ns*/) {}

  /// Counts of an encoder that does not wrap: of its wheel now, and at any angle.
  [[nodiscard]] std::int64_t position(bool upper_wheel) const noexcept {
    const plant_sim::PlantState& s = plant_.state();
    return position_at(upper_wheel, upper_wheel ? s.angle1_rad : s.angle2_rad);
  }
  [[nodiscard]] std::int64_t position_at(bool upper_wheel, double angle_rad) const noexcept {
    return (upper_wheel ? upper_ : lower_).position(angle_rad);
  }
  /// Absolute speed of the faster wheel.
  [[nodiscard]] double fastest_rad_s() const noexcept {
    const plant_sim::PlantState& s = plant_.state();
    return std::max(std::abs(s.omega1_rad_s), std::abs(s.omega2_rad_s));
  }
  /// The overspeed interlock of a board: it stays on until the wheels stand.
  void latch_overspeed(bool too_fast) noexcept {
    overspeed_latched_ = too_fast || (overspeed_latched_ && fastest_rad_s() >= standstill_rad_s);
  }
  [[nodiscard]] bool emergency_stop() const noexcept { return emergency_stop_; }
  /// Notes the duties in the log if they have changed.
  void note_outputs(const std::string& why) { log_.note(time_ns_, outputs(), why, last_reload_ns()); }
  /// When the watchdog was last reloaded; -1: never, or there is none.
  [[nodiscard]] virtual std::int64_t last_reload_ns() const noexcept { return -1; }

  BoardOptions options_;
  OutputLog log_{};
  bool overspeed_latched_{false};

 private:
  plant_sim::Plant plant_;
  plant_sim::Encoder upper_;
  plant_sim::Encoder lower_;
  std::int64_t time_ns_{0};
  bool emergency_stop_{false};
};

}  // namespace abs_hil::emulator
