#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abs_hil/rig/phase.hpp"

// Faults injected between the executive and any backend except real hardware (docs/fault-injection.md).
namespace abs_hil::config {

/// Where a fault acts: on a part of the measurement, a part of the command, or a whole call.
enum class InjectionSignal : std::uint8_t {
  encoder_upper,
  encoder_lower,
  encoders,  ///< both at once
  stamp,     ///< time at which the counters were read
  supply,
  temperature,
  trip,  ///< the board's own interlocks
  read,  ///< the whole answer
  motor_pwm,
  brake_pwm,
  enable,
  write,  ///< the whole command
};
inline constexpr std::size_t injection_signal_count = 12;

/// What a fault does. docs/fault-injection.md tells the meaning of each kind for each signal.
enum class InjectionKind : std::uint8_t { ok, off, stuck, garbage, wrong, slow, delayed, intermittent };
inline constexpr std::size_t injection_kind_count = 8;

/// One fault: when, where, what. Trivially copyable.
struct Injection {
  std::optional<rig::Phase> phase{};  ///< time counts from the first cycle of this phase; none: of the run
  InjectionSignal signal{InjectionSignal::read};
  InjectionKind kind{InjectionKind::ok};
  double parameter{0.0};  ///< factor, offset, seconds or probability, depending on the kind; 0 if the kind has none
  double delay_s{0.0};    ///< in [0, 600]
  double duration_s{std::numeric_limits<double>::infinity()};  ///< > 0
  friend bool operator==(const Injection&, const Injection&) = default;
};

/// Parses one fault such as "brake@encoder_upper:stuck+0.2s". The syntax is
///
///     PHASE@SIGNAL:KIND[=PARAMETER][+DELAY][~DURATION]
///
/// with PHASE one of idle accelerate coast brake hold stopped any, times as 0.2s or 200ms. Throws
/// std::invalid_argument, naming the part, what is allowed in its place and an example.
[[nodiscard]] Injection parse_injection(std::string_view text);
/// Parses several faults, separated by commas or blanks. An empty text gives none.
[[nodiscard]] std::vector<Injection> parse_injections(std::string_view list);
/// The fault in the syntax of `parse_injection`.
[[nodiscard]] std::string to_text(const Injection& injection);

[[nodiscard]] std::string_view name_of(InjectionSignal signal) noexcept;
[[nodiscard]] std::string_view name_of(InjectionKind kind) noexcept;

}  // namespace abs_hil::config
