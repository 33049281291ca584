#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "abs_hil/plant_sim/factor_profile.hpp"
#include "report/run_files.hpp"
#include "report/run_survey.hpp"

namespace abs_hil::report {

/// Finds from the rows when the parameters of the simulated rig changed according to the run's configuration. Skips
/// profiles that cannot be read.
class PlantChangeFinder {
 public:
  explicit PlantChangeFinder(const RunFiles& run);

  /// Processes the next row. A profile over distance changes at the first row that has reached the distance; unknown
  /// speeds (NaN) add no distance.
  /// @param braking  in phase `brake`
  /// @param road_speed_m_s  speed of the lower wheel's rim
  void see(double time_s, bool braking, double road_speed_m_s);
  /// Changes that the run reached, in the order of the parameters.
  [[nodiscard]] std::vector<PlantChange> changes() const;

 private:
  /// One parameter's profile and the run's position in it.
  struct Profile {
    std::string what;
    plant_sim::FactorProfile profile;
    bool counting{false};
    double origin{0.0};    ///< zero of the profile's axis, s or m since the start of the run
    std::size_t piece{0};  ///< index of the present piece
    std::vector<PlantChange> changes{};
  };
  static void advance(Profile& profile, double time_s, double rolled_m);

  std::vector<Profile> profiles_;
  bool started_{false};
  double rolled_m_{0.0};  ///< since the first row, by the trapezoidal rule
  double last_time_s_{0.0};
  double last_speed_m_s_{0.0};
};

}  // namespace abs_hil::report
