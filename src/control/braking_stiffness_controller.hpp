#pragma once

#include <array>

#include "abs_hil/control/controller_context.hpp"
#include "abs_hil/control/paper_laws.hpp"
#include "control/wheel_force_observer.hpp"
#include "control/wheel_motion.hpp"

namespace abs_hil::control {

/// Slope of the tyre force over the slip by least squares with fading memory: the extended braking stiffness. Where the
/// slip has hardly moved, the slope is that of a force proportional to the slip. Real-time safe.
class BrakingStiffness {
 public:
  /// @param memory_s  time constant of forgetting, > 0
  /// @param slip_noise  standard deviation of the slip that tells nothing
  BrakingStiffness(double memory_s, double slip_noise) noexcept : memory_s_{memory_s}, slip_noise_{slip_noise} {}

  void reset() noexcept;
  void learn(double dt_s, double slip, double force_N) noexcept;
  /// d ln F / d ln slip at the mean of late, in [-1, 1]: 1 far below the peak, 0 at it, negative past it.
  [[nodiscard]] double elasticity() const noexcept;

 private:
  double memory_s_;
  double slip_noise_;
  double slip_{0.0}, force_N_{0.0};  ///< means
  double variance_{0.0}, covariance_N_{0.0};
};

/// Seeks the peak of the tyre force by the extended braking stiffness (Umeno, 2002; Hoang et al., 2014): the logarithm
/// of the wanted slip moves in proportion to the elasticity of the force less a small wanted one, with a small sine on
/// it. The loop feeds the observed force forward and steps back through the brake's lag. It knows nothing of the tyre.
/// theta_est_N is NaN, slip_ref its own reference.
class BrakingStiffnessController final : public SlipController {
 public:
  /// Throws std::invalid_argument for options out of range.
  explicit BrakingStiffnessController(const ControllerContext& context);

  void reset(const SlipInput& input) noexcept override;
  [[nodiscard]] SlipOutput step(const SlipInput& input) noexcept override;
  [[nodiscard]] std::span<const rig::Signal> signals() const noexcept override;

 private:
  BrakingStiffnessOptions options_;
  rig::RigParameters rig_;
  paper::Laws<double> laws_;
  BrakeLag lag_;
  double period_s_;
  double v_min_m_s_;
  WheelForceObserver observer_;
  BrakingStiffness stiffness_;
  double late_slip_{0.0};  ///< as late as the observed force
  double reference_{0.0};  ///< without the sine
  double search_rad_{0.0};
};

}  // namespace abs_hil::control
