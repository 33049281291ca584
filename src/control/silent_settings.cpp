#include "control/silent_settings.hpp"

#include <string_view>

#include "rig/formatted_text.hpp"

namespace abs_hil::control {

namespace {

void look_at(const AdaptiveOptions& gains, const char* prefix, std::vector<std::string>& found) {
  if (gains.q12 != 0.0) {
    found.push_back(
        rig::formatted("%sq12 = %g has no effect: the laws use B'P of PA + A'P = -2Q, which does not "
                       "contain it; use q11 and q22",
                       prefix, gains.q12));
  }
}

}  // namespace

std::vector<std::string> silent_settings(const ControlOptions& options) {
  std::vector<std::string> found;
  if (options.controller == "adaptive") look_at(options.adaptive, "control.adaptive.", found);
  if (options.controller == "adaptive-actuator") {
    look_at(options.adaptive_actuator.law, "control.adaptive_actuator.", found);
  }
  return found;
}

}  // namespace abs_hil::control
