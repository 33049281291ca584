// The classical Runge-Kutta step of fourth order, and the loop over steps: the only ones, for a plant in the cycle (a
// `double`) and for many side by side (a pack).
//
//   k1 = f(x), k2 = f(x + h/2 k1), k3 = f(x + h/2 k2), k4 = f(x + h k3),  x(t + h) = x + h/6 (k1 + 2 k2 + 2 k3 + k4)
//
// f is the right-hand side of (1), (2) and (6) (torque_balance.hpp) and h the step, s.
#pragma once

#include <cstddef>
#include <type_traits>

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

/// For `steps_made`: no step ends the loop after it.
struct NeverHalts {};

/// Moves `x` by up to `steps` equal steps where `where` holds. It stops before a step unless `well(its end)`, and after
/// one if `halts(its start, its end)`. Returns the number of steps made.
template <class S, class Balance, class Condition, class Well, class Halts = NeverHalts>
[[nodiscard, gnu::always_inline]] inline S steps_made(const Balance& balance, const S& steps, const S& step_s,
                                                      Condition where, BasicState<S>& x, const Well& well,
                                                      const Halts& halts = {}) noexcept {
  S made(0.0);
  for (;;) {
    where = where && made < steps;
    if (!rig::any(where)) return made;
    const BasicState<S> end = runge_kutta_step(balance, x, step_s);
    where = where && well(end);
    if (!rig::any(where)) return made;
    made = rig::select(where, S(made + 1.0), made);
    const Condition moves = where;
    if constexpr (!std::is_same_v<Halts, NeverHalts>) where = where && !halts(x, end);
    for (std::size_t i = 0; i < x.size(); ++i) x[i] = rig::select(moves, end[i], x[i]);
  }
}

}  // namespace abs_hil::plant_sim
