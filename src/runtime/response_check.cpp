// The reasons for which the momentum check ends a run.
#include "runtime/response_check.hpp"

namespace abs_hil::runtime {

CheckResult ResponseCheck::update(const SpeedWindow& speed_window, double brake_Nm) noexcept {
  using rig::Reason;
  if (!take(speed_window, brake_Nm)) return {};
  const auto verdict = conclude(true);
  if (!verdict.due) return {};
  if (verdict.rises) return {Reason::speed_rises_with_motor_off, verdict.gained_kg_m_s};
  if (verdict.motor_silent) return {Reason::motor_no_response, verdict.gained_kg_m_s};
  if (verdict.brake_silent) return {Reason::brake_no_response, verdict.gained_kg_m_s};
  return {};
}

}  // namespace abs_hil::runtime
