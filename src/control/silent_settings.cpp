#include "control/silent_settings.hpp"

#include <string_view>

#include "rig/formatted_text.hpp"

namespace abs_hil::control {

namespace {

void look_at(const AdaptiveOptions& gains, const char* prefix, const rig::RigParameters& rig,
             std::vector<std::string>& found) {
  if (gains.q12 != 0.0) {
    found.push_back(
        rig::formatted("%sq12 = %g has no effect: the laws use B'P of PA + A'P = -2Q, which does not "
                       "contain it; use q11 and q22",
                       prefix, gains.q12));
  }
  if (gains.theta_max_N < rig.tyre.theta_N) {
    found.push_back(
        rig::formatted("%stheta_max_N = %g N is below the tyre's theta of %g N: the estimate stops there; "
                       "set %stheta_max_N above it",
                       prefix, gains.theta_max_N, rig.tyre.theta_N, prefix));
  }
  if (gains.theta_min_N > rig.tyre.theta_N) {
    found.push_back(
        rig::formatted("%stheta_min_N = %g N is above the tyre's theta of %g N: the estimate stops there; "
                       "set %stheta_min_N below it",
                       prefix, gains.theta_min_N, rig.tyre.theta_N, prefix));
  }
}

}  // namespace

std::vector<std::string> silent_settings(const ControlOptions& options, const rig::RigParameters& rig) {
  std::vector<std::string> found;
  if (options.controller == "adaptive") look_at(options.adaptive, "control.adaptive.", rig, found);
  if (options.controller == "adaptive-actuator") {
    look_at(options.adaptive_actuator.law, "control.adaptive_actuator.", rig, found);
  }
  return found;
}

}  // namespace abs_hil::control
