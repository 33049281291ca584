#include "control/braking_stiffness_controller.hpp"

#include <array>
#include <stdexcept>

#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::control {
namespace {

const BrakingStiffnessOptions& checked(const BrakingStiffnessOptions& o) {
  rig::require_valid(o, "control.braking_stiffness.");
  if (!(o.slip_min <= o.slip_start && o.slip_start <= o.slip_max)) {
    throw std::invalid_argument("control.braking_stiffness.slip_start must be in [slip_min, slip_max]");
  }
  return o;
}

}  // namespace

template <class S>
BrakingStiffnessLaw<S>::BrakingStiffnessLaw(const ControllerContext& context)
  requires std::is_same_v<S, double>
    : laws_{paper::laws(context.rig.wheels)},
      brake_{context.rig.brake},
      lag_{context.rig.brake.c31_per_s, 1.0 / context.options.rate_Hz},
      v_min_m_s_{context.options.v_min_m_s} {
  const BrakingStiffnessOptions& o = checked(context.options.braking_stiffness);
  torque_decay_ = rig::exponential_less_one(-o.lag_gain_per_s * (1.0 / context.options.rate_Hz));
  target_ = o.target;
  rate_per_s_ = o.rate_per_s;
  slip_min_ = o.slip_min;
  slip_max_ = o.slip_max;
  slip_start_ = o.slip_start;
  search_part_ = o.search_part;
  search_rad_s_ = o.search_rad_s;
  slip_gain_per_s_ = o.slip_gain_per_s;
  observer_ = {o.observer, context.rig, context.options.rate_Hz};
  stiffness_ = {o.memory_s, o.slip_noise};
}

template class BrakingStiffnessLaw<double>;

SlipOutput BrakingStiffnessController::step(const SlipInput& input) noexcept {
  SlipOutput output = law_.step(input);
  output.signals[0] = law_.elasticity();
  return output;
}

std::span<const rig::Signal> BrakingStiffnessController::signals() const noexcept {
  static constexpr std::array<rig::Signal, 1> rows{
      {{"elasticity", "estimated relative growth of the tyre force per relative growth of the slip"}}};
  return rows;
}

}  // namespace abs_hil::control
