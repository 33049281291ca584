#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "abs_hil/rig/range.hpp"
#include "abs_hil/rig/reason.hpp"

// The table of what may end a phase. Experiment files, their schema, `abs_hil validate` and the sequence of phases are
// made from it.

namespace abs_hil::experiment {

// clang-format off
/// One row each: kind; its key in an experiment's file (empty: a file cannot name it), the unit and the range of its
/// value (none: it has no value), the key's meaning; how it reads after "until" ({}: the value); the reason that is
/// recorded; `estimate` if one wrong sample of speed or slip could fulfil it; the condition itself, as the sequence
/// evaluates it (Sequence::holds).
#define ABS_HIL_END_CONDITIONS(ROW)                                                                                   \
  ROW(duration, "lasts", "s", rig::from_zero(599), "the phase has lasted this long",                                  \
      "it has lasted {} s", phase_duration_over, exact, input.time_s - entered_at_s_ >= value)                        \
  ROW(upper_speed_above, "upper_speed_above", "rad/s", rig::from_zero(2000), "the upper wheel is at least this fast", \
      "the upper wheel reaches {} rad/s", speed_threshold_reached, estimate, input.speeds.omega1_rad_s >= value)      \
  ROW(upper_speed_below, "upper_speed_below", "rad/s", rig::from_zero(2000), "the upper wheel is slower than this",   \
      "the upper wheel is slower than {} rad/s", speed_condition_met, estimate, input.speeds.omega1_rad_s < value)    \
  /* A wheel that has not begun to turn has no peak yet. */                                                           \
  ROW(upper_wheel_peak, "upper_wheel_peak", "s", rig::positive(86'400),                                               \
      "the upper wheel has gained no speed for this long", "the upper wheel has gained no speed for {} s",            \
      upper_wheel_peak_detected, exact,                                                                               \
      peak_speed_rad_s_ > peak_margin_rad_s && input.time_s - peak_at_s_ >= value)                                    \
  ROW(lower_speed_above, "lower_speed_above", "rad/s", rig::from_zero(2000), "the lower wheel is at least this fast", \
      "the lower wheel reaches {} rad/s", speed_condition_met, estimate, input.speeds.omega2_rad_s >= value)          \
  ROW(lower_speed_below, "lower_speed_below", "rad/s", rig::from_zero(2000), "the lower wheel is slower than this",   \
      "the lower wheel is slower than {} rad/s", speed_condition_met, estimate, input.speeds.omega2_rad_s < value)    \
  ROW(car_speed_above, "car_speed_above", "m/s", rig::from_zero(200),                                                 \
      "the car (the lower wheel's rim) is at least this fast",                                                        \
      "the car reaches {} m/s", speed_condition_met, estimate, input.car_speed_m_s >= value)                          \
  ROW(car_speed_below, "car_speed_below", "m/s", rig::from_zero(200), "the car is slower than this",                  \
      "the car is slower than {} m/s", end_speed_reached, estimate, input.car_speed_m_s < value)                      \
  ROW(slip_above, "slip_above", "", rig::between(-1, 1), "the estimated slip is at least this",                       \
      "the slip reaches {}", slip_condition_met, estimate, input.slip >= value)                                       \
  ROW(slip_below, "slip_below", "", rig::between(-1, 1), "the estimated slip is less than this",                      \
      "the slip is less than {}", slip_condition_met, estimate, input.slip < value)                                   \
  ROW(distance, "distance", "m", rig::positive(1e5), "the car has come this far since the phase began",               \
      "the car has travelled {} m in it", distance_reached, exact, input.distance_m - entered_at_m_ >= value)         \
  ROW(standstill, "standstill", "", rig::Range{}, "both wheels stand",                                                \
      "both wheels stand", standstill_reached, exact, input.stands_still)                                             \
  ROW(start_command, "", "", rig::Range{}, "a start command arrived",                                                 \
      "the start is given", start_command, exact, input.start_given)                                                  \
  ROW(answer, "", "", rig::Range{}, "the phase's question was answered",                                              \
      "the question is answered", question_answered, exact, input.answered)                                           \
  ROW(all, "", "", rig::Range{}, "all parts of the condition hold at the same time",                                  \
      "", all_conditions_met, exact, all_hold(condition.parts, input))
// clang-format on

/// What ends a phase. All speeds are estimates.
enum class EndKind : std::uint8_t {
// NOLINTBEGIN(cppcoreguidelines-macro-usage): the names of the rows
#define ABS_HIL_END_KIND(kind, ...) kind,
  ABS_HIL_END_CONDITIONS(ABS_HIL_END_KIND)
#undef ABS_HIL_END_KIND
};

struct EndRow {
  std::string_view key;
  std::string_view unit;
  rig::Range range;
  std::string_view meaning;
  std::string_view in_words;
  rig::Reason reason;
  bool on_estimates;
  [[nodiscard]] constexpr bool takes_value() const noexcept { return range.least < range.most; }
};

namespace end_row_words {
inline constexpr bool exact = false;
inline constexpr bool estimate = true;
}  // namespace end_row_words

inline constexpr std::array end_rows{
#define ABS_HIL_END_ROW(kind, key, unit, range, meaning, in_words, reason, precision, ...) \
  EndRow{key, unit, range, meaning, in_words, rig::Reason::reason, end_row_words::precision},
    ABS_HIL_END_CONDITIONS(ABS_HIL_END_ROW)
#undef ABS_HIL_END_ROW
    // NOLINTEND(cppcoreguidelines-macro-usage)
};

[[nodiscard]] constexpr const EndRow& row_of(EndKind kind) noexcept { return end_rows[static_cast<std::size_t>(kind)]; }

}  // namespace abs_hil::experiment
