#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "abs_hil/plant_sim/factor_profile.hpp"
#include "report/run_files.hpp"
#include "report/run_survey.hpp"

namespace abs_hil::report {

/// Finds, row by row, when the simulated rig became another one, as the run's configuration says. Profiles that cannot
/// be read are left out.
class PlantChangeFinder {
 public:
  explicit PlantChangeFinder(const RunFiles& run);

  /// The next row. What is over distance changes at the first row that is so far; speeds that are not known (NaN) lead
  /// nowhere.
  /// @param braking  in phase `brake`
  /// @param road_speed_m_s  of the lower wheel's rim
  void see(double time_s, bool braking, double road_speed_m_s);
  /// Those that the run reached, in the order of the parameters.
  [[nodiscard]] std::vector<PlantChange> changes() const;

 private:
  /// One parameter's profile, and how far the run has come in it.
  struct Profile {
    std::string what;
    plant_sim::FactorProfile profile;
    bool counting{false};
    double origin{0.0};    ///< s or m since the start of the run
    std::size_t piece{0};  ///< present one
    std::vector<PlantChange> changes{};
  };
  static void advance(Profile& profile, double time_s, double rolled_m);

  std::vector<Profile> courses_;
  bool started_{false};
  double rolled_m_{0.0};  ///< since the first row, by the trapezoidal rule
  double last_time_s_{0.0};
  double last_speed_m_s_{0.0};
};

}  // namespace abs_hil::report
