#pragma once

#include <cstdint>
#include <string_view>

#include "abs_hil/driver/rig_driver.hpp"
#include "abs_hil/plant_sim/plant.hpp"

namespace abs_hil::driver {

/// How a simulated run begins.
struct SimStart {
  std::uint64_t seed{1};          ///< where within a count the encoders' wheels stand at the start
  double start_speed_rad_s{0.0};  ///< both wheels' speed at activation, >= 0
};

/// The simulated rig at the level of the card: encoder counts out, 12-bit duty cycles in. The plant moves on with the
/// time given to `read`, under the command of the last `write`, so that a late cycle meets a plant that has moved on.
class SimDriver final : public RigDriver {
 public:
  /// Throws std::invalid_argument if an option or the start speed is outside its range.
  SimDriver(const plant_sim::PlantOptions& plant, const SimStart& start);
  ~SimDriver() override;

  [[nodiscard]] std::string_view name() const noexcept override { return "sim"; }
  [[nodiscard]] rig::PlantTruth truth() const noexcept override;
  /// For tests: what acts on the simulated rig now.
  [[nodiscard]] const plant_sim::PlantInput& outputs() const noexcept { return input_; }
  [[nodiscard]] const plant_sim::Plant& plant() const noexcept { return plant_; }

 private:
  void do_configure() override;
  void do_activate(std::int64_t now_ns) override;
  IoResult do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept override;
  IoResult do_write(const rig::Command& command) noexcept override;
  IoResult do_make_safe() noexcept override;

  plant_sim::Plant plant_;
  SimStart start_;
  plant_sim::PlantInput input_{};
  std::int64_t time_ns_{0};       ///< when the plant's state holds
  double upper_offset_rad_{0.0};  ///< where within a count the upper wheel's encoder started
  double lower_offset_rad_{0.0};  ///< where within a count the lower wheel's encoder started
};

}  // namespace abs_hil::driver
