#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "abs_hil/control/controller_context.hpp"
#include "abs_hil/control/registry.hpp"
#include "abs_hil/control/slip_controller.hpp"
#include "interchange/fmu_facts.hpp"
#include "interchange/foreign_code.hpp"
#include "runtime/cycle_statistics.hpp"

namespace abs_hil::interchange {

/// Where the code of controllers from files runs.
enum class Home {
  own_process,   ///< abs_controller_host: a crash ends the run with a fault, and nothing is lost
  this_process,  ///< at once, as a board needs it: a crash ends the program, and the guardian makes the outputs safe
};

/// Trials of foreign code before a run in real time.
struct ForeignTrial {
  StepTimes times{};
  Offences offences{};
  bool died_without_system{false};  ///< the code did not bear it that its system calls failed: it needs them
};

/// Code from a file as a slip controller.
class ForeignController final : public control::SlipController {
 public:
  /// Throws std::invalid_argument, which names the file, if it holds no usable controller.
  ForeignController(const std::string& file, const control::ControllerContext& context, Home home);

  void reset(const control::SlipInput& input) noexcept override;
  [[nodiscard]] control::SlipOutput step(const control::SlipInput& input) noexcept override;
  [[nodiscard]] std::span<const rig::Signal> signals() const noexcept override { return signals_; }

  [[nodiscard]] const std::string& file() const noexcept { return file_; }
  /// The file with its code: of a class in Python, its module's.
  [[nodiscard]] std::string source() const { return code_->source().empty() ? file_ : code_->source(); }
  /// Runs the code over trial inputs, in a process of its own first. Call it before anything moves. Throws
  /// std::invalid_argument if the code dies in it, or if its steps take longer than the control period.
  [[nodiscard]] ForeignTrial try_out();
  /// Durations of its steps in the run so far.
  [[nodiscard]] const runtime::LatencyHistogram& step_times() const noexcept { return *step_times_; }
  /// Why it gives no outputs any more; empty while it does. Not real-time safe.
  [[nodiscard]] std::string failure() const { return code_->failure(); }

 private:
  std::string file_;
  ForeignSetup setup_;
  std::unique_ptr<ExtractedFmu> fmu_;  ///< outlives the code
  std::unique_ptr<ForeignCode> code_;
  std::vector<rig::Signal> signals_;
  std::unique_ptr<runtime::LatencyHistogram> step_times_;
  double time_s_{0.0};
};

/// Calls `take(name, foreign, own)` for each quantity that both inputs have: a law's, and those of the C interface.
template <class Foreign, class Own, class Take>
void for_each_input(Foreign& foreign, Own& own, const Take& take) {
  take("dt_s", foreign.dt_s, own.dt_s);
  take("omega1_rad_s", foreign.omega1_rad_s, own.speeds.omega1_rad_s);
  take("omega2_rad_s", foreign.omega2_rad_s, own.speeds.omega2_rad_s);
  take("slip", foreign.slip, own.slip);
  take("slip_ref", foreign.slip_ref, own.slip_ref);
  take("mean_brake_torque_Nm", foreign.mean_brake_torque_Nm, own.mean_brake_torque_Nm);
  take("brake_torque_Nm", foreign.brake_torque_Nm, own.brake_torque_Nm);
  take("max_brake_torque_Nm", foreign.max_brake_torque_Nm, own.max_brake_torque_Nm);
  take("alpha1_rad_s2", foreign.alpha1_rad_s2, own.alpha1_rad_s2);
  take("alpha2_rad_s2", foreign.alpha2_rad_s2, own.alpha2_rad_s2);
  take("upper_travel_rad", foreign.upper_travel_rad, own.upper_travel_rad);
  take("lower_travel_rad", foreign.lower_travel_rad, own.lower_travel_rad);
  take("sent_brake_torque_Nm", foreign.sent_brake_torque_Nm, own.sent_brake_torque_Nm);
  take("unsent_torque_Nm", foreign.unsent_torque_Nm, own.unsent_torque_Nm);
}
/// The same for the outputs, but for the signals of the controller's own.
template <class Foreign, class Own, class Take>
void for_each_output(Foreign& foreign, Own& own, const Take& take) {
  take("brake_torque_Nm", foreign.brake_torque_Nm, own.brake_torque_Nm);
  take("slip_velocity_error_m_s", foreign.slip_velocity_error_m_s, own.slip_velocity_error_m_s);
  take("theta_est_N", foreign.theta_est_N, own.theta_est_N);
  take("slip_ref", foreign.slip_ref, own.slip_ref);
}

/// What a law is told and answers, in the terms of the C interface.
[[nodiscard]] control::SlipInput slip_input(const abs_hil_input& foreign) noexcept;
[[nodiscard]] abs_hil_output foreign_output(const control::SlipOutput& out) noexcept;

/// The controller of a file FILE.agent. Throws std::invalid_argument, which names the file, if it is no page of an
/// agent.
[[nodiscard]] std::unique_ptr<control::SlipController> make_agent_controller(const std::string& file,
                                                                             const control::ControllerContext& context);

/// What makes controllers from files (docs/interchange.md), those of agents too. Code of files runs in a process of its
/// own until `set_home` says otherwise.
[[nodiscard]] std::array<control::ControllerFiles, 4> foreign_controllers() noexcept;
/// Lets the registry make them.
void register_foreign_controllers();
/// @param files_unprotected  a person accepts code that could change files, where the kernel has no Landlock
void set_home(Home home, bool files_unprotected) noexcept;

}  // namespace abs_hil::interchange
