// What the drivers of all boards share: refusals, checks of options and commands, counters, an emulator's time.

#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include "abs_hil/driver/backend.hpp"
#include "abs_hil/driver/io_result.hpp"
#include "abs_hil/driver/rig_driver.hpp"
#include "abs_hil/rig/command.hpp"
#include "abs_hil/rig/duty_grid.hpp"
#include "abs_hil/rig/option_check.hpp"
#include "abs_hil/rig/time_units.hpp"
#include "rig/encoder_scale.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::driver {

/// How well a fact about a board is known.
enum class Standing : std::uint8_t {
  documented,  ///< stated in the maker's own driver sources or manual
  inferred,    ///< concluded from these, but not stated there
  unknown,     ///< these sources are silent or disagree: the driver never relies on it
};
[[nodiscard]] constexpr std::string_view name_of(Standing standing) noexcept {
  constexpr std::array<std::string_view, 3> names{"documented", "inferred", "unknown"};
  return names[static_cast<std::size_t>(standing)];
}

/// Ends the program with status 3. `what` names the board, the cause and the fix.
[[noreturn]] inline void refuse(const std::string& what) { throw Unavailable("backend rig: " + what); }

/// Throws std::invalid_argument, naming the key, if an option is outside its range.
/// @param board  prefix of the keys, "driver.pci."
template <class Options>
void check_options(const std::string& board, const Options& options) {
  rig::require_valid(options, board);
  for (const auto& [key, sign] : {std::pair("lower_sign", options.lower_sign), {"upper_sign", options.upper_sign}}) {
    if (sign == 1 || sign == -1) continue;
    throw std::invalid_argument(board + key + " = " + std::to_string(sign) + ": give 1 or -1");
  }
  const auto require_different = [&board](const char* first, std::int32_t of_first, const char* second,
                                          std::int32_t of_second, const char* why) {
    if (of_first != of_second) return;
    throw std::invalid_argument(board + first + " = " + board + second + " = " + std::to_string(of_second) + ": " +
                                why);
  };
  if constexpr (requires { options.lower_channel; }) {
    require_different("lower_channel", options.lower_channel, "upper_channel", options.upper_channel,
                      "each wheel has an encoder of its own");
  }
  if constexpr (requires { options.drive_pwm; }) {
    require_different("drive_pwm", options.drive_pwm, "brake_pwm", options.brake_pwm,
                      "drive and brake need different PWMs");
  }
}

/// False if a duty is not in [0, 1], the torque is < 0, or a value is not finite.
[[nodiscard]] inline bool in_range(const rig::Command& command) noexcept {
  const auto is_duty = [](double value) { return value >= 0.0 && value <= 1.0; };  // false for NaN
  return is_duty(command.motor_duty) && is_duty(command.brake_duty) && std::isfinite(command.brake_torque_Nm) &&
         command.brake_torque_Nm >= 0.0;
}

/// The command that acts when the outputs have these widths.
[[nodiscard]] constexpr rig::Command command_shown(std::uint32_t motor_width, std::uint32_t brake_width,
                                                   std::uint32_t duty_steps) noexcept {
  return {.motor_duty = rig::duty_of(motor_width, duty_steps),
          .brake_duty = rig::duty_of(brake_width, duty_steps),
          .motor_enable = motor_width > 0};
}

/// The counter as a signed number, negated if `sign` is -1. Real-time safe.
[[nodiscard]] inline std::int32_t with_sign(std::uint32_t raw, std::int32_t sign) noexcept {
  return std::bit_cast<std::int32_t>(sign < 0 ? 0U - raw
                                              : raw);  // unsigned arithmetic: the most negative count has no negative
}

/// True if a counter can have moved from `before` to `after` in `elapsed_ns`, which is >= 0, at the options' largest
/// plausible speed.
template <class Options>
[[nodiscard]] bool plausible_travel(std::int32_t before, std::int32_t after, std::int64_t elapsed_ns,
                                    const Options& options) noexcept {
  /// Counts allowed in addition to what the speed explains, because of vibration, late reads and delays on a bus.
  constexpr double slack_counts = 256.0;
  const double most = slack_counts + options.plausible_speed_rad_s * static_cast<double>(elapsed_ns) * rig::s_per_ns /
                                         rig::radians_per_count(options.encoder_counts_per_rev);
  return std::abs(static_cast<double>(rig::counts_between(before, after))) <= most;
}

/// Counts travelled between two readings of a counter that wraps and is their lowest `bits` bits. Real-time safe.
[[nodiscard]] inline std::int32_t travelled(std::uint32_t before, std::uint32_t after, unsigned bits) noexcept {
  const unsigned unused = 32U - bits;
  return std::bit_cast<std::int32_t>((after - before) << unused) >> unused;
}

/// The count after `moved` more; it wraps.
[[nodiscard]] inline std::int32_t counts_after(std::int32_t counts, std::int32_t moved) noexcept {
  return std::bit_cast<std::int32_t>(std::bit_cast<std::uint32_t>(counts) + std::bit_cast<std::uint32_t>(moved));
}

/// How long a cycle waits for the board's answer, ns: at most 80 % of the period. Throws std::invalid_argument, naming
/// the key.
/// @param share  of the period, if the options give no time
template <class Options>
[[nodiscard]] std::int64_t answer_timeout_ns(const std::string& board, const Options& options, double share) {
  constexpr double most_share = 0.8;
  const double period_us = 1e6 / options.rate_Hz;
  if (options.answer_timeout_us > most_share * period_us) {
    throw std::invalid_argument(
        rig::formatted("%sanswer_timeout_us = %d: give at most %.0f us (80 %% of the period), or 0 for %.0f %% of it",
                       board.c_str(), options.answer_timeout_us, most_share * period_us, 100.0 * share));
  }
  const double us = options.answer_timeout_us > 0 ? options.answer_timeout_us : share * period_us;
  return static_cast<std::int64_t>(us * static_cast<double>(rig::ns_per_us));
}

/// What the drivers of all boards have: the steps and caps of their outputs, and a clock.
class BoardDriver : public RigDriver {
 public:
  using ReadClock = std::int64_t (*)() noexcept;
  [[nodiscard]] rig::Command as_sent(const rig::Command& command) const noexcept final {
    return grid_.as_sent(command);
  }

 protected:
  /// @param read_clock  the clock of `now_ns`; null in virtual time, where reading takes no time
  explicit BoardDriver(const OutputGrid& grid, ReadClock read_clock = nullptr) noexcept
      : grid_(grid), read_clock_(read_clock) {}
  [[nodiscard]] std::int64_t clock_ns(std::int64_t otherwise) const noexcept {
    return read_clock_ == nullptr ? otherwise : read_clock_();
  }

  OutputGrid grid_;
  ReadClock read_clock_;
};

/// The clock of an emulated board in lock-step: it advances only when the driver says so. No hardware has such a clock.
class EmulatedTime {
 public:
  virtual ~EmulatedTime() = default;

  virtual IoResult now(std::int64_t& time_ns) noexcept = 0;
  /// Advances the emulated rig to `time_ns` and returns when that is done.
  virtual IoResult advance_to(std::int64_t time_ns) noexcept = 0;

  /// Its time from now on is ours less a constant: `now_ns` is now.
  IoResult start(std::int64_t now_ns) noexcept {
    const IoResult result = now(ahead_ns_);
    ahead_ns_ -= now_ns;
    return result;
  }
  /// Advances it to our time.
  IoResult follow(std::int64_t now_ns) noexcept { return advance_to(ahead_ns_ + now_ns); }

 private:
  std::int64_t ahead_ns_{0};
};

/// Refuses a board without an emulator's mark where the run relies on one. Throws Unavailable.
inline void require_mark(const std::string& board, bool emulated, bool marked) {
  if (!emulated || marked) return;
  refuse(board + " does not carry an emulator's mark: it counts as real. Remove driver.emulated, or name an emulator");
}

/// Refuses a board with its own time under --fast, and an emulator in lock-step without --fast. Throws Unavailable.
/// @param board      how messages name it
/// @param lock_step  the program advances the board's time
/// @param waits      the board is an emulator that waits for that
/// @param start_with options that start such an emulator
inline void require_lock_step(const std::string& board, bool lock_step, bool waits,
                              const std::string& start_with = "--lock-step") {
  if (lock_step && !waits) {
    refuse(board +
           " keeps its own time: it is hardware, or an emulator in real time. Omit --fast, or start abs_rig_emulator "
           "with " +
           start_with);
  }
  if (!lock_step && waits) {
    refuse(board +
           " is an emulator in lock-step: give --fast to advance its time, or start "
           "abs_rig_emulator without --lock-step");
  }
}

/// Leaky bucket as in LinuxCNC's hostmot2: it tolerates single losses and trips on sustained loss. It stays tripped
/// until `reset`. Real-time safe.
class LossBucket {
 public:
  /// @param cost  level that a loss adds, > 0
  /// @param relief  level that a good cycle takes away, > 0
  /// @param limit  level at which it trips, > 0
  constexpr LossBucket(std::int32_t cost, std::int32_t relief, std::int32_t limit) noexcept
      : cost_(cost), relief_(relief), limit_(limit) {}

  constexpr void lost() noexcept {
    level_ = std::min(level_ + cost_, limit_);
    if (level_ >= limit_) tripped_ = true;
  }
  constexpr void good() noexcept { level_ = std::max(level_ - relief_, 0); }
  constexpr void reset() noexcept {
    level_ = 0;
    tripped_ = false;
  }
  [[nodiscard]] constexpr bool tripped() const noexcept { return tripped_; }

 private:
  std::int32_t cost_;
  std::int32_t relief_;
  std::int32_t limit_;
  std::int32_t level_{0};
  bool tripped_{false};
};

}  // namespace abs_hil::driver
