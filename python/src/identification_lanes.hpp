// The plants of a window side by side in lanes, where both wheels turn.
#pragma once

#include <memory>
#include <optional>
#include <variant>

#include "identification_plant.hpp"
#include "lanes/lane_plant.hpp"
#include "study/lanes/lane_jobs.hpp"

namespace abs_hil::python {

using lanes::WindowKernel;

/// Rows of a log, and what acts in them.
struct Window {
  std::ptrdiff_t first;  // row
  std::ptrdiff_t last;   // row at which the next window begins
  bool contact{false};
  bool brake{false};
  bool motor{false};
};

/// Plants of the same kind as words for lanes: the undisturbed one for each state that is moved, and each varied one.
class Lanes {
 public:
  virtual ~Lanes() = default;
  /// Simulates the window from `starts` (columns of plants, states). False where lanes cannot.
  virtual bool pass(const std::vector<const Inputs*>& inputs, const Window& window,
                    const std::vector<std::array<double, states>>& starts) = 0;
  [[nodiscard]] double angle(std::ptrdiff_t row, std::ptrdiff_t wheel, std::size_t column) const {
    return angles_[static_cast<std::size_t>(row * angles + wheel) * lanes_ + column];
  }
  /// Of the states in the order of `values_of`.
  [[nodiscard]] double end(std::ptrdiff_t state, std::size_t column) const {
    constexpr std::size_t place[states] = {plant_sim::angle1, plant_sim::angle2, plant_sim::omega1, plant_sim::omega2,
                                           plant_sim::brake_torque};
    return ends_[place[state] * lanes_ + column];
  }

 protected:
  std::size_t lanes_{0};
  std::vector<double> angles_, ends_;
};

template <template <class> class Tyre, template <class> class Load>
class LanesOf : public Lanes {
 public:
  using Plant = lanes::LanePlant<double, Tyre<double>, Load<double>>;

  /// Null if these plants are of another kind.
  static std::unique_ptr<Lanes> of(const std::vector<const DelayedPlant*>& plants, study::lanes::InstructionSet set) {
    std::vector<Plant> words;
    for (const DelayedPlant* plant : plants) {
      const auto one = words_of(*plant);
      if (!one) return nullptr;
      words.push_back(*one);
    }
    return std::make_unique<LanesOf>(std::move(words), kernel_of(set));
  }
  LanesOf(std::vector<Plant> plants, WindowKernel kernel) : plants_(std::move(plants)), kernel_(kernel) {
    const std::size_t groups = (plants_.size() + kernel.lanes - 1) / kernel.lanes;
    lanes_ = groups * kernel.lanes;
    ends_.resize(static_cast<std::size_t>(states) * lanes_);
    for (Plant& plant : plants_) pointers_.push_back(reinterpret_cast<double*>(&plant));
  }

  bool pass(const std::vector<const Inputs*>& inputs, const Window& window,
            const std::vector<std::array<double, states>>& starts) override {
    const bool apart = inputs[0]->apart(window.first);
    if (!take_durations(*inputs[0], window, apart)) return false;
    bool late = false;
    for (std::size_t i = 0; i < plants_.size(); ++i) {
      plant_sim::StateVector& x = plants_[i].x;
      x[plant_sim::angle1] = starts[i][0];
      x[plant_sim::angle2] = starts[i][1];
      x[plant_sim::omega1] = starts[i][2];
      x[plant_sim::omega2] = starts[i][3];
      x[plant_sim::brake_torque] = starts[i][4];
      // No torque lets a wheel break away that touches nothing.
      plants_[i].upper_turns = apart && starts[0][2] == 0.0 ? 0.0 : 1.0;
      if (plants_[i].upper_turns == 0.0) x[plant_sim::omega1] = 0.0;
      late = late || plants_[i].delay_s > 0.0;
    }
    const std::size_t rows = durations_s_.size();
    angles_.resize(static_cast<std::size_t>(angles) * rows * lanes_);
    const bool whole = lanes_ == kernel_.lanes;  // one pass fills the arrays themselves
    part_angles_.resize(whole ? 0 : static_cast<std::size_t>(angles) * rows * kernel_.lanes);
    part_ends_.resize(whole ? 0 : static_cast<std::size_t>(states) * kernel_.lanes);
    std::vector<double>&to_angles = whole ? angles_ : part_angles_, &to_ends = whole ? ends_ : part_ends_;
    for (std::size_t begin = 0; begin < plants_.size(); begin += kernel_.lanes) {
      const std::size_t count = std::min(kernel_.lanes, plants_.size() - begin);
      take_duties(inputs, window, begin, count);
      if (!kernel_.pass({pointers_.data() + begin, count, durations_s_.data(), duties_.data(), rows, apart, late,
                         to_angles.data(), to_ends.data()}))
        return false;
      if (whole) continue;
      copy(part_angles_, angles_, begin);
      copy(part_ends_, ends_, begin);
    }
    return true;
  }

 private:
  static std::optional<Plant> words_of(const DelayedPlant& delayed) {
    const PlantOptions& options = delayed.plant.options();
    const plant_sim::TyreModel tyres = plant_sim::make_tyre_model(options);
    const auto* tyre = std::get_if<Tyre<double>>(&tyres);
    if (tyre == nullptr || options.ideal_actuator || !options.friction_profile.empty() ||
        plant_sim::Drift(options.drift).any() || options.rig.brake.brake_dead_time_s > 0.0 ||
        options.rig.motor.start_until_rad_s > 0.0 || options.rig.motor.middle_until_rad_s > 0.0 ||
        options.brake_flaws != plant_sim::BrakeFlaws{.release_ratio = options.brake_flaws.release_ratio})
      return std::nullopt;
    const plant_sim::LoadModel loads = plant_sim::make_load_model(options, tyre->peak_mu(), 1.0);
    const auto* load = std::get_if<Load<double>>(&loads);
    if (load == nullptr) return std::nullopt;
    Plant plant;
    plant.tyre = *tyre;
    plant.load = *load;
    plant.wheels = plant_sim::BasicWheels<double>(options.rig.wheels);
    plant.brake = rig::BasicBrake<double>(options.rig.brake);
    if (const double limit = options.rig.brake.brake_rate_limit_Nm_s; limit > 0.0) plant.brake_limit_Nm_s = limit;
    plant.brake_release_ratio = options.brake_flaws.release_ratio;
    plant.motor_stall_Nm = options.rig.motor.stall_torque_Nm;
    plant.motor_no_load_rad_s = options.rig.motor.no_load_speed_rad_s;
    plant.max_step_s = options.max_step_s;
    plant.delay_s = delayed.delay_s;
    return plant;
  }
  static WindowKernel kernel_of(study::lanes::InstructionSet set) {
    using Kind = lanes::WindowKind<Tyre, Load>;
    using lanes::window_kernel;
#ifdef ABS_HIL_WIDE_LANES
    if (set == study::lanes::InstructionSet::avx512) return window_kernel<rig::Avx512, Kind>();
    if (set == study::lanes::InstructionSet::avx2) return window_kernel<rig::Avx2, Kind>();
#endif
    return window_kernel<rig::Portable, Kind>();
  }
  /// False if the wheels part or join within the window.
  bool take_durations(const Inputs& inputs, const Window& window, bool apart) {
    durations_s_.clear();
    for (std::ptrdiff_t row = window.first; row < window.last; ++row) {
      if (inputs.apart(row) != apart) return false;
      durations_s_.push_back(inputs.time_s.data()[row + 1] - inputs.time_s.data()[row]);
    }
    return true;
  }
  /// Of the plants from `begin` on; free lanes repeat the first of them.
  void take_duties(const std::vector<const Inputs*>& inputs, const Window& window, std::size_t begin,
                   std::size_t count) {
    duties_.resize(durations_s_.size() * lanes::duties * kernel_.lanes);
    double* to = duties_.data();
    for (std::ptrdiff_t row = window.first; row < window.last; ++row) {
      for (std::size_t lane = 0; lane < kernel_.lanes; ++lane, ++to) {
        const Inputs& own = *inputs[begin + (lane < count ? lane : 0)];
        const plant_sim::PlantInput now = own.at(row), earlier = own.before(row);
        to[lanes::motor_duty * kernel_.lanes] = now.motor_duty;
        to[lanes::brake_duty * kernel_.lanes] = now.brake_duty;
        to[lanes::earlier_motor_duty * kernel_.lanes] = earlier.motor_duty;
        to[lanes::earlier_brake_duty * kernel_.lanes] = earlier.brake_duty;
      }
      to += (lanes::duties - 1) * kernel_.lanes;
    }
  }
  void copy(const std::vector<double>& from, std::vector<double>& to, std::size_t begin) const {
    for (std::size_t i = 0; i * kernel_.lanes < from.size(); ++i)
      std::copy_n(from.data() + i * kernel_.lanes, kernel_.lanes, to.data() + i * lanes_ + begin);
  }

  std::vector<Plant> plants_;
  std::vector<double*> pointers_;
  WindowKernel kernel_;
  std::vector<double> durations_s_, duties_;
  std::vector<double> part_angles_, part_ends_;
};

/// Null if there are no lanes for these plants, or ABS_HIL_LANES=none.
inline std::unique_ptr<Lanes> lanes_of(const std::vector<const DelayedPlant*>& plants) {
  const study::lanes::InstructionSet set = study::lanes::instruction_set();
  if (set == study::lanes::InstructionSet::none) return nullptr;
  std::unique_ptr<Lanes> found;
#define ABS_HIL_TRY(tyre, load) \
  if (!found) found = LanesOf<tyre, load>::of(plants, set);
  ABS_HIL_WINDOW_KINDS(ABS_HIL_TRY)
#undef ABS_HIL_TRY
  return found;
}

}  // namespace abs_hil::python
