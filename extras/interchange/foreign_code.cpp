// Loads foreign code by the kind of its file, and names what went wrong in it.
#include "interchange/foreign_code.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "abs_hil/rig/option.hpp"
#include "runtime/clock.hpp"

namespace abs_hil::interchange {

abs_hil_input trial_input(std::int64_t step, double period_s) noexcept {
  constexpr double start_rad_s = 170.0;
  constexpr double deceleration_rad_s2 = 60.0;
  constexpr double slip = 0.15;
  constexpr double lasts_s = 2.0;  // the lower wheel then still turns with 50 rad/s
  const double time_s = std::fmod(static_cast<double>(step) * period_s, lasts_s);
  const double omega_rad_s = start_rad_s - deceleration_rad_s2 * time_s;
  return {.time_s = time_s,
          .dt_s = step == 0 ? 0.0 : period_s,
          .omega1_rad_s = (1.0 - slip) * omega_rad_s,
          .omega2_rad_s = omega_rad_s,
          .slip = slip,
          .slip_ref = slip,
          .mean_brake_torque_Nm = 2.0,
          .brake_torque_Nm = 2.0,
          .max_brake_torque_Nm = 9.0,
          .alpha1_rad_s2 = -(1.0 - slip) * deceleration_rad_s2,
          .alpha2_rad_s2 = -deceleration_rad_s2,
          .upper_travel_rad = (1.0 - slip) * omega_rad_s * period_s,
          .lower_travel_rad = omega_rad_s * period_s,
          .sent_brake_torque_Nm = 2.0,
          .unsent_torque_Nm = 0.0};
}

abs_hil_output no_output() noexcept {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  abs_hil_output output{
      .brake_torque_Nm = nan, .slip_velocity_error_m_s = nan, .theta_est_N = nan, .slip_ref = nan, .signals = {}};
  std::ranges::fill(output.signals, nan);
  return output;
}

StepTimes warm_up(ForeignCode& code, double period_s, std::int64_t steps) {
  runtime::MonotonicClock clock;
  std::vector<std::int64_t> durations_ns;
  durations_ns.reserve(static_cast<std::size_t>(steps));
  code.reset(trial_input(0, period_s));
  for (std::int64_t step = 0; step < steps; ++step) {
    const abs_hil_input input = trial_input(step, period_s);
    abs_hil_output output = no_output();
    const std::int64_t before_ns = clock.now_ns();
    code.step(input, output);
    durations_ns.push_back(clock.now_ns() - before_ns);
    if (!code.failure().empty()) break;
  }
  if (code.failure().empty()) code.be_fresh();
  if (durations_ns.empty()) return {};
  std::ranges::sort(durations_ns);
  const std::size_t count = durations_ns.size();
  return {.steps = static_cast<std::int64_t>(count),
          .median_ns = durations_ns[count / 2],
          .p99_ns = durations_ns[count - 1 - count / 100],
          .worst_ns = durations_ns.back()};
}

std::unique_ptr<ForeignCode> load_here(const ForeignSetup& setup) {
  if (setup.file.extension() == ".so") return load_library(setup);
  if (setup.file.extension() == ".fmu") return load_fmu(setup);
  if (rig::FileEndings::is_python_class(setup.file.native())) {
    throw std::invalid_argument(
        setup.file.string() +
        ": a class in Python cannot control a board, whose commands must come in time; write it "
        "in C or C++ (docs/writing-a-controller.md), or use --backend sim");
  }
  throw std::invalid_argument(setup.file.string() + ": give a shared library (.so) or an FMU (.fmu)");
}

}  // namespace abs_hil::interchange
