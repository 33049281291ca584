#include "control/adaptive_peak_controller.hpp"

#include <stdexcept>

#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::control {
namespace {

const AdaptivePeakOptions& checked(const AdaptivePeakOptions& o) {
  rig::require_valid(o, "control.adaptive_peak.");
  if (!(o.slip_min < o.slip_max))
    throw std::invalid_argument("control.adaptive_peak.slip_min must be below control.adaptive_peak.slip_max");
  if (!(o.slip_start >= o.slip_min && o.slip_start <= o.slip_max)) {
    throw std::invalid_argument("control.adaptive_peak.slip_start must be in [slip_min, slip_max]");
  }
  return o;
}

}  // namespace

template <class S>
AdaptivePeakLaw<S>::AdaptivePeakLaw(const ControllerContext& context)
  requires std::is_same_v<S, double>
    : laws_{paper::laws(context.rig.wheels)},
      lag_{context.rig.brake.c31_per_s, 1.0 / context.options.rate_Hz},
      v_min_m_s_{context.options.v_min_m_s},
      period_s_{1.0 / context.options.rate_Hz} {
  const AdaptivePeakOptions& o = checked(context.options.adaptive_peak);
  gains_.ks0 = o.ks0;
  gains_.ks1 = o.ks1;
  lag_decay_ = rig::exponential_less_one(-o.lag_gain_per_s * period_s_);
  slip_min_ = o.slip_min;
  slip_max_ = o.slip_max;
  slip_start_ = o.slip_start;
  slip_rate_per_s_ = o.slip_rate_per_s;
  search_part_ = o.search_part;
  search_min_ = o.search_min;
  search_rad_s_ = o.search_rad_s;
  observer_ = {o.observer, context.rig, context.options.rate_Hz};
  peak_ = {o.peak, o.slip_min, o.slip_max, context.options.rate_Hz};
}

template class AdaptivePeakLaw<double>;

}  // namespace abs_hil::control
