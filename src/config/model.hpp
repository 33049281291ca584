#pragma once

#include <string>
#include <vector>

#include "config/script.hpp"
#include "config/settings.hpp"

namespace abs_hil::config {

/// A value of the model that is not the plant's.
struct ModelDifference {
  std::string name;  ///< without prefix: "theta_N"
  double model{0.0};
  double plant{0.0};
};

/// Where the model differs from the simulated plant; nowhere on a rig, whose plant is unknown.
[[nodiscard]] std::vector<ModelDifference> model_differences(const Settings& settings);

/// "theta_N 23 (plant 40), c31_per_s 16 (plant 20.37)"; empty if no difference is visible in six digits.
[[nodiscard]] std::string in_words(const std::vector<ModelDifference>& differences);

/// Says where the true theta, or on a rig the model's, lies outside the bounds of the controller's estimate; empty:
/// nowhere. The estimate then stays at its bound.
[[nodiscard]] std::vector<std::string> theta_out_of_bounds(const Settings& settings);

/// Says if a wheel that still turns at the experiment's end speed can seem to stand: it then takes longer from count to
/// count than control.observer.standstill_time_s. Empty: it cannot.
[[nodiscard]] std::string standstill_too_early(const Settings& settings);

/// Says if the gate's cap of the brake's duty keeps the wheel from the wanted slip on the tyre of (10): below the peak
/// it must hold more torque than the capped brake gives. Empty: it does not, or no phase controls the slip that
/// control.slip_ref gives.
[[nodiscard]] std::string slip_out_of_reach(const Script& script, const Settings& settings);

/// Says where the brake's map (7) is negative at the end u0 of its dead zone, in the plant or, on a rig or where it
/// differs, in the model; empty: nowhere. The dead zone is then wider than u0 says.
[[nodiscard]] std::vector<std::string> negative_at_dead_zone(const Settings& settings);

}  // namespace abs_hil::config
