#pragma once

#include "abs_hil/control/controller_context.hpp"
#include "abs_hil/control/slip_controller.hpp"

namespace example {

/// The example of docs/writing-a-controller.md. A torque that roughly holds the wanted slip, and a
/// part in proportion to the slip error:
///   Tb = base + gain (slip_ref - slip)
struct ProportionalOptions {
  double base_Nm{2.0};   ///< torque at the wanted slip, >= 0
  double gain_Nm{10.0};  ///< torque per unit of slip error, > 0
};

class ProportionalController final : public abs_hil::control::SlipController {
 public:
  /// Throws std::invalid_argument for options out of range.
  explicit ProportionalController(const abs_hil::control::ControllerContext& context,
                                  const ProportionalOptions& options = {});

  void reset(const abs_hil::control::SlipInput& input) noexcept override;
  [[nodiscard]] abs_hil::control::SlipOutput step(const abs_hil::control::SlipInput& input) noexcept override;

 private:
  abs_hil::rig::WheelParameters wheels_;
  ProportionalOptions options_;
};

}  // namespace example
