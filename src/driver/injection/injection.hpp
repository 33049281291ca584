#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "abs_hil/rig/phase.hpp"

// Faults planted at the I/O seam, between the executive and any backend but real hardware (docs/fault-injection.md).
namespace abs_hil::driver {

/// What a fault sits in: a part of the measurement, a part of the command, or a whole call.
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

/// What becomes of it. docs/fault-injection.md says what each means for each signal.
enum class InjectionKind : std::uint8_t { ok, off, stuck, garbage, wrong, slow, delayed, intermittent };
inline constexpr std::size_t injection_kind_count = 8;

/// One fault: when, where, what. Trivially copyable.
struct Injection {
  std::optional<rig::Phase> phase{};  ///< counts from the first cycle of this phase; none: from the run's first
  InjectionSignal signal{InjectionSignal::read};
  InjectionKind kind{InjectionKind::ok};
  double parameter{0.0};  ///< of the kind: factor, offset, seconds or probability; 0 where it takes none
  double delay_s{0.0};    ///< in [0, 600]
  double duration_s{std::numeric_limits<double>::infinity()};  ///< > 0
  friend bool operator==(const Injection&, const Injection&) = default;
};

/// "brake@encoder_upper:stuck+0.2s", in general
///
///     PHASE@SIGNAL:KIND[=PARAMETER][+DELAY][~DURATION]
///
/// with PHASE one of idle accelerate coast brake hold stopped any, times as 0.2s or 200ms. Throws
/// std::invalid_argument, naming the part, what is allowed in its place and an example.
[[nodiscard]] Injection parse_injection(std::string_view text);
/// Several, separated by commas or blanks; none for an empty text.
[[nodiscard]] std::vector<Injection> parse_injections(std::string_view list);
/// In the form that `parse_injection` takes.
[[nodiscard]] std::string to_text(const Injection& injection);

[[nodiscard]] std::string_view name_of(InjectionSignal signal) noexcept;
[[nodiscard]] std::string_view name_of(InjectionKind kind) noexcept;

}  // namespace abs_hil::driver
