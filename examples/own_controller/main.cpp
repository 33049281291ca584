// abs_hil with its own controller, on the simulated and on the real rig, with every option of abs_hil.
#include <abs_hil/control/slip_error_dynamics.hpp>
#include <abs_hil/program/program.hpp>
#include <abs_hil/rig/option_check.hpp>

namespace {

using namespace abs_hil::control;

/// Gains: the keys control.proportional.*, one row each.
struct ProportionalOptions {
  ABS_HIL_OPTIONS(ProportionalOptions);
  ABS_HIL_OPTION(double, base_Nm, 2.0, .unit = "N m", .meaning = "torque at the wanted slip",
                 .range = abs_hil::rig::from_zero(15));
  ABS_HIL_OPTION(double, gain_Nm, 10.0, .unit = "N m", .meaning = "torque per unit of slip error",
                 .range = abs_hil::rig::positive(1000));
};

/// Torque proportional to the slip error, around a torque that roughly holds the slip reference.
class Proportional final : public SlipController {
 public:
  using Options = ProportionalOptions;
  Proportional(const ControllerContext& context, const Options& options)
      : wheels_{context.rig.wheels}, options_{options} {
    abs_hil::rig::require_valid(options_, "control.proportional.");
  }

  void reset(const SlipInput&) noexcept override {}

  [[nodiscard]] SlipOutput step(const SlipInput& input) noexcept override {
    return {.brake_torque_Nm = options_.base_Nm + options_.gain_Nm * (input.slip_ref - input.slip),
            .slip_velocity_error_m_s = slip_velocity_error_m_s(wheels_, input.speeds, input.slip_ref),
            .theta_est_N = abs_hil::rig::unknown};
  }

 private:
  abs_hil::rig::WheelParameters wheels_;
  Options options_;
};

constexpr ControllerEntry own[]{
    controller_entry<Proportional>("proportional", "torque proportional to the slip error")};

}  // namespace

int main(int argc, char** argv) { return abs_hil::program::run_program(argc, argv, own); }
