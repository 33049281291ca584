#pragma once

#include "abs_hil/control/controller_context.hpp"
#include "abs_hil/control/slip_controller.hpp"

namespace example {

/// Gains of ProportionalController: the keys control.proportional.*, one row each.
struct ProportionalOptions {
  ABS_HIL_OPTIONS(ProportionalOptions);
  ABS_HIL_OPTION(double, base_Nm, 2.0, .unit = "N m", .meaning = "torque at the wanted slip",
                 .range = abs_hil::rig::from_zero(15), .search = abs_hil::rig::search(0.5, 5));
  ABS_HIL_OPTION(double, gain_Nm, 10.0, .unit = "N m", .meaning = "torque per unit of slip error",
                 .range = abs_hil::rig::positive(1000), .search = abs_hil::rig::search(1, 100));
};

/// A torque that roughly holds the wanted slip, and a part in proportion to the slip error:
///   Tb = base + gain (slip_ref - slip)
class ProportionalController final : public abs_hil::control::SlipController {
 public:
  using Options = ProportionalOptions;
  /// Throws std::invalid_argument for options out of range.
  explicit ProportionalController(const abs_hil::control::ControllerContext& context, const Options& options = {});

  void reset(const abs_hil::control::SlipInput& input) noexcept override;
  [[nodiscard]] abs_hil::control::SlipOutput step(const abs_hil::control::SlipInput& input) noexcept override;

 private:
  abs_hil::rig::WheelParameters wheels_;
  Options options_;
};

}  // namespace example
