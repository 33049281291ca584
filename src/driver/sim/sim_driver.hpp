#pragma once

#include <cstdint>
#include <string_view>

#include "abs_hil/plant_sim/plant.hpp"
#include "driver/board_kit.hpp"
#include "driver/board_options.hpp"
#include "plant_sim/encoder.hpp"

namespace abs_hil::driver {

/// Start of a simulated run.
struct SimStart {
  std::uint64_t seed{1};          ///< seed for the wheels' initial angles within one encoder count
  double start_speed_rad_s{0.0};  ///< both wheels' speed at activation, >= 0
  PwmMode pwm_mode{PwmMode::bits_12};
};

/// The wheels' initial angles within one count.
struct CountOffsets {
  double upper_rad{0.0};
  double lower_rad{0.0};
};
/// @param seed  as SimStart has it
[[nodiscard]] CountOffsets count_offsets(std::uint64_t seed, double rad_per_count);

/// The simulated rig at the level of the card: encoder counts out, duty cycles of 12 or 8 bits in. `read` advances the
/// plant to the given time under the command of the last `write`. In a late cycle the plant has therefore moved on,
/// too.
class SimDriver final : public BoardDriver {
 public:
  /// Throws std::invalid_argument if an option or the start speed is outside its range.
  SimDriver(const plant_sim::PlantOptions& plant, const SimStart& start);
  ~SimDriver() override { static_cast<void>(deactivate()); }

  [[nodiscard]] std::string_view name() const noexcept override { return "sim"; }
  [[nodiscard]] rig::PlantTruth truth() const noexcept override { return plant_.truth(); }
  void note_wheels_apart(bool apart) noexcept override { plant_.part_wheels(apart); }
  void scale_friction(double factor) noexcept { plant_.scale_friction(factor); }
  /// For tests: the command that acts on the simulated rig.
  [[nodiscard]] const plant_sim::PlantInput& outputs() const noexcept { return input_; }
  [[nodiscard]] const plant_sim::Plant& plant() const noexcept { return plant_; }
  /// Of an active driver.
  void exchange_state(rig::StateBytes& state) {
    plant_.exchange_state(state);
    state(input_, time_ns_, offsets_);
  }

 private:
  void do_configure() override {}  // the plant's options were checked when it was made
  void do_activate(std::int64_t now_ns) override;
  IoResult do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept override;
  IoResult do_write(const rig::Command& command, rig::Command& sent) noexcept override;
  IoResult do_make_safe() noexcept override;

  plant_sim::Plant plant_;
  plant_sim::Encoder upper_;
  plant_sim::Encoder lower_;
  SimStart start_;
  plant_sim::PlantInput input_{};
  std::int64_t time_ns_{0};  ///< time of the plant's state
  CountOffsets offsets_{};
};

}  // namespace abs_hil::driver
