#pragma once

#include "abs_hil/control/options.hpp"

namespace bench {

/// Gains of the adaptive law that suit any rig, its estimate unbounded. `between(low, high)` draws a number.
template <typename Between>
void draw_gains(abs_hil::control::AdaptiveOptions& options, Between between) {
  options.gamma = between(5.0, 50.0);
  options.ks0 = between(5.0, 50.0);
  options.ks1 = between(15.0, 60.0);
  options.ka1 = between(0.3, 3.0);
  options.q11 = between(0.5, 3.0);
  options.q22 = between(0.5, 3.0);
  options.theta_min_N = -1000.0;
  options.theta_max_N = 1000.0;
}

}  // namespace bench
