// Loads foreign code by the kind of its file, calls a controller in a shared library through
// abs_hil/interchange/controller.h, and names what went wrong in it.
#include "interchange/foreign_code.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <string_view>

#include "abs_hil/rig/option.hpp"
#include "runtime/clock.hpp"

namespace abs_hil::interchange {
namespace {

constexpr const char* interface_name = "abs_hil_controller_interface";
constexpr const char* create_name = "abs_hil_controller_create";
constexpr const char* header_name = "abs_hil/interchange/controller.h";

void check_size(const std::filesystem::path& file, const char* what, std::uint32_t its, std::size_t ours) {
  if (its == ours) return;
  refuse(file, fmt::format("its {} has {} bytes, that of this program has {}; build it with this program's {}", what,
                           its, ours, header_name));
}

/// The library, if version and sizes that it states for itself are those of this program.
LoadedLibrary loaded(const std::filesystem::path& file) {
  LoadedLibrary library(file, file);
  const auto* const its = library.find<const abs_hil_controller_interface_t>(interface_name);
  if (its->magic != ABS_HIL_CONTROLLER_MAGIC) {
    refuse(file, fmt::format("its {} does not begin as it should; build it with {}", interface_name, header_name));
  }
  if (its->version != ABS_HIL_CONTROLLER_VERSION) {
    refuse(file, fmt::format("it has version {} of the interface, this program has version {}; build it with this "
                             "program's {}",
                             its->version, ABS_HIL_CONTROLLER_VERSION, header_name));
  }
  check_size(file, "abs_hil_setup", its->setup_size, sizeof(abs_hil_setup));
  check_size(file, "abs_hil_input", its->input_size, sizeof(abs_hil_input));
  check_size(file, "abs_hil_output", its->output_size, sizeof(abs_hil_output));
  return library;
}

class LibraryCode final : public ForeignCode {
 public:
  explicit LibraryCode(const ForeignSetup& setup) : library_(loaded(setup.file)) {
    make(setup);
    for (std::uint32_t n = 0; const char* name = signal_(controller_, n); ++n) {
      if (n == ABS_HIL_CONTROLLER_SIGNALS) {
        destroy_(controller_);
        refuse(setup.file, fmt::format("it has more than {} signals", ABS_HIL_CONTROLLER_SIGNALS));
      }
      signals_.emplace_back(name);
    }
  }
  LibraryCode(const LibraryCode&) = delete;
  LibraryCode& operator=(const LibraryCode&) = delete;
  ~LibraryCode() override { destroy_(controller_); }

  void reset(const abs_hil_input& input) noexcept override { reset_(controller_, &input); }
  void step(const abs_hil_input& input, abs_hil_output& output) noexcept override {
    step_(controller_, &input, &output);
  }

 private:
  void make(const ForeignSetup& setup) {
    std::vector<abs_hil_parameter> parameters;
    for (const auto& [name, value] : setup.parameters) parameters.push_back({name.c_str(), value});
    const abs_hil_setup told{.size = sizeof(abs_hil_setup),
                             .parameter_count = static_cast<std::uint32_t>(parameters.size()),
                             .parameters = parameters.data(),
                             .period_s = setup.period_s};
    std::array<char, 256> error{};
    controller_ = create_(&told, error.data(), error.size());
    if (controller_ != nullptr) return;
    const std::string_view reason(error.data(), ::strnlen(error.data(), error.size()));
    refuse(setup.file, fmt::format("{} failed: {}", create_name, reason.empty() ? "it gives no reason" : reason));
  }

  LoadedLibrary library_;
  decltype(abs_hil_controller_create)* create_{library_.find<decltype(abs_hil_controller_create)>(create_name)};
  decltype(abs_hil_controller_reset)* reset_{
      library_.find<decltype(abs_hil_controller_reset)>("abs_hil_controller_reset")};
  decltype(abs_hil_controller_step)* step_{library_.find<decltype(abs_hil_controller_step)>("abs_hil_controller_step")};
  decltype(abs_hil_controller_signal)* signal_{
      library_.find<decltype(abs_hil_controller_signal)>("abs_hil_controller_signal")};
  decltype(abs_hil_controller_destroy)* destroy_{
      library_.find<decltype(abs_hil_controller_destroy)>("abs_hil_controller_destroy")};
  void* controller_{nullptr};
};

}  // namespace

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

std::unique_ptr<ForeignCode> load_library(const ForeignSetup& setup) { return std::make_unique<LibraryCode>(setup); }

}  // namespace abs_hil::interchange
