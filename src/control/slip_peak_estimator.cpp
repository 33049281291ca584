// Makes a peak estimator from its options. slip_peak_estimator.hpp has the equations.
#include "control/slip_peak_estimator.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::control {
namespace {

constexpr double jump_window_s = 0.015;
constexpr double rollback_s = 0.03;
constexpr double kept_every_s = 1e-3;

double at_least_one(double count) { return std::max(1.0, std::round(count)); }

}  // namespace

template <class S>
BasicSlipPeakEstimator<S>::BasicSlipPeakEstimator(const SlipPeakOptions<>& options, double slip_min, double slip_max,
                                                  double rate_Hz)
    : options_{options},
      log_force0_{rig::logarithm(options.peak_force0_N)},
      log_width0_{rig::logarithm(options.peak_slip0)},
      log_slip_min_{rig::logarithm(slip_min)},
      log_slip_max_{rig::logarithm(slip_max)},
      sample_variance_N2_{options.force_noise_N2_s * rate_Hz},
      decimation_{at_least_one(kept_every_s * rate_Hz)},
      window_{at_least_one(jump_window_s * rate_Hz / decimation_)},
      rollback_{at_least_one(rollback_s * rate_Hz / decimation_)} {
  rig::require_valid(options, "control.adaptive_peak.");
  if (!(0.0 < slip_min && slip_min < slip_max && rate_Hz > 0.0)) {
    throw std::invalid_argument("the slip peak estimator needs 0 < slip_min < slip_max and a control rate > 0 Hz");
  }
  if (!(options.peak_slip0 >= slip_min && options.peak_slip0 <= slip_max)) {
    throw std::invalid_argument("control.adaptive_peak.peak_slip0 must be in [slip_min, slip_max]");
  }
  reset();
}

template class BasicSlipPeakEstimator<double>;

}  // namespace abs_hil::control
