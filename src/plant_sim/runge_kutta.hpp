// The classical Runge-Kutta step of fourth order: x(t + h) = x + h/6 (k1 + 2 k2 + 2 k3 + k4).
#pragma once

#include <cstddef>

#include "abs_hil/rig/scalar.hpp"
#include "plant_sim/torque_balance.hpp"

namespace abs_hil::plant_sim {

/// Ratio of step and time constant of the slip dynamics. RK4 is stable up to 2.78; tests/plant_sim/accuracy_test.cpp
/// shows the error at this value.
inline constexpr double slip_time_constant_fraction = 0.3;

/// `a` moved along `rates` for `step_s`.
template <class S>
[[nodiscard, gnu::always_inline]] inline BasicState<S> moved(const BasicState<S>& a, const S& step_s,
                                                             const BasicState<S>& rates) noexcept {
  BasicState<S> end;
  for (std::size_t i = 0; i < end.size(); ++i) end[i] = a[i] + step_s * rates[i];
  return end;
}

/// One classical Runge-Kutta step of fourth order from `x`. `balance(x, time)` gives the rates.
template <class S, class Balance>
[[nodiscard, gnu::always_inline]] inline BasicState<S> runge_kutta_step(const Balance& balance, const BasicState<S>& x,
                                                                        const S& step_s) noexcept {
  const S half_s = 0.5 * step_s;
  const BasicState<S> k1 = balance(x, S(0.0));
  const BasicState<S> k2 = balance(moved(x, half_s, k1), half_s);
  const BasicState<S> k3 = balance(moved(x, half_s, k2), half_s);
  const BasicState<S> k4 = balance(moved(x, step_s, k3), step_s);
  BasicState<S> mean;
  for (std::size_t i = 0; i < mean.size(); ++i) mean[i] = (k1[i] + 2.0 * (k2[i] + k3[i])) + k4[i];
  return moved(x, S(step_s * (1.0 / 6.0)), mean);
}

/// Number of equal steps for `duration_s` > 0: none longer than `max_step_s` and than the slip dynamics allow.
template <class S>
[[nodiscard]] inline S steps_for(const S& duration_s, const S& max_step_s, const S& fastest_rate_per_s) noexcept {
  const S steps =
      rig::larger(S(duration_s / max_step_s), S(duration_s * fastest_rate_per_s * (1.0 / slip_time_constant_fraction)));
  return rig::larger(S(1.0), rig::round_up(steps));
}

}  // namespace abs_hil::plant_sim
