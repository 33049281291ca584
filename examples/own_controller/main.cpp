// abs_hil with its own controller, on the simulated and on the real rig, with every option of abs_hil.
#include <abs_hil/control/slip_error_dynamics.hpp>
#include <abs_hil/program/program.hpp>

namespace {

using namespace abs_hil::control;

/// Torque proportional to the slip error, around a torque that roughly holds the slip reference.
class Proportional final : public SlipController {
 public:
  explicit Proportional(const ControllerContext& context) : wheels_{context.rig.wheels} {}

  void reset(const SlipInput&) noexcept override {}

  [[nodiscard]] SlipOutput step(const SlipInput& input) noexcept override {
    constexpr double base_Nm = 2.0, gain_Nm = 10.0;
    return {.brake_torque_Nm = base_Nm + gain_Nm * (input.slip_ref - input.slip),
            .slip_velocity_error_m_s = slip_velocity_error_m_s(wheels_, input.speeds, input.slip_ref),
            .theta_est_N = abs_hil::rig::unknown};
  }

 private:
  abs_hil::rig::WheelParameters wheels_;
};

constexpr ControllerEntry own[]{
    controller_entry<Proportional>("proportional", "torque proportional to the slip error")};

}  // namespace

int main(int argc, char** argv) { return abs_hil::program::run_program(argc, argv, own); }
