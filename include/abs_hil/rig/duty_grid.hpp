#pragma once

#include <algorithm>
#include <cstdint>

namespace abs_hil::rig {

// A PWM that counts `steps` steps gives the duties 0, 1/steps, ... 1 and no others. Its width is the number of steps.
// With 0 steps any duty can be given. All functions are real-time safe and take duties in [0, 1].

namespace detail {
/// Rounding may put a duty that equals a width just beside it.
inline constexpr double width_slack = 1e-9;
}  // namespace detail

/// The duty of a width.
[[nodiscard]] constexpr double duty_of(std::uint32_t width, std::uint32_t steps) noexcept {
  return static_cast<double>(width) / static_cast<double>(steps);
}

/// Width nearest to a duty, but never above the cap, which is in [0, 1].
[[nodiscard]] constexpr std::uint32_t width_for(std::uint32_t steps, double duty, double duty_max) noexcept {
  const auto cap = static_cast<std::uint32_t>(duty_max * static_cast<double>(steps) + detail::width_slack);
  // lround is not constexpr. NOLINTNEXTLINE(bugprone-incorrect-roundings)
  const auto width = static_cast<std::uint32_t>(duty * static_cast<double>(steps) + 0.5);
  return std::min(width, cap);
}

/// The largest duty that the PWM gives and that is not above `duty_max`.
[[nodiscard]] constexpr double duty_at_most(double duty_max, std::uint32_t steps) noexcept {
  return steps == 0 ? duty_max : duty_of(width_for(steps, 1.0, duty_max), steps);
}

/// The least duty that the PWM gives and that is not below `duty_min`: `duty_at_least(u, n) >= u`, always.
[[nodiscard]] constexpr double duty_at_least(double duty_min, std::uint32_t steps) noexcept {
  if (steps == 0) return duty_min;
  auto width = static_cast<std::uint32_t>(duty_min * static_cast<double>(steps));
  while (width < steps && duty_of(width, steps) < duty_min) ++width;
  return duty_of(width, steps);
}

}  // namespace abs_hil::rig
