// A controller from a file as one of the registry: where its code runs, and its trial before a run.
#include "interchange/foreign_controller.hpp"

#include <fmt/format.h>

#include <atomic>
#include <stdexcept>
#include <type_traits>

#include "interchange/hosted_code.hpp"
#include "runtime/clock.hpp"

namespace abs_hil::interchange {

namespace {

std::atomic<Home> chosen_home{Home::own_process};
std::atomic<bool> unprotected_accepted{false};

/// Trial steps of a warm-up: 2 s at 1 kHz.
constexpr std::uint32_t trial_steps = 2000;

template <class Options>
void add_numbers(const Options& options, const std::string& prefix,
                 std::vector<std::pair<std::string, double>>& parameters) {
  rig::for_each_option(options, prefix, [&](const std::string& name, const rig::OptionFacts&, const auto& value) {
    using Value = std::remove_cvref_t<decltype(value)>;
    if constexpr (!std::is_same_v<Value, std::string>) parameters.emplace_back(name, static_cast<double>(value));
  });
}

ForeignSetup setup_of(const std::string& file, const control::ControllerContext& context) {
  ForeignSetup setup{.file = file,
                     .mapping = context.options.foreign.mapping,
                     .period_s = 1.0 / context.options.rate_Hz,
                     .files_unprotected = unprotected_accepted.load()};
  add_numbers(context.options, "control.", setup.parameters);
  add_numbers(context.rig, "model.", setup.parameters);
  return setup;
}

/// An FMU, unpacked, if it is one. Its description can be checked without running the file's code.
std::unique_ptr<ExtractedFmu> check(ForeignSetup& setup) {
  if (setup.file.extension() != ".fmu") return nullptr;
  auto fmu = std::make_unique<ExtractedFmu>(setup.file);
  setup.folder = fmu->folder();
  static_cast<void>(facts_of(setup.file, setup.folder, setup.mapping));
  return fmu;
}

abs_hil_input foreign_input(const control::SlipInput& own, double time_s) noexcept {
  abs_hil_input foreign{};
  foreign.time_s = time_s;
  for_each_input(foreign, own, [](std::string_view, double& to, double from) { to = from; });
  return foreign;
}

}  // namespace

control::SlipInput slip_input(const abs_hil_input& foreign) noexcept {
  control::SlipInput own{};
  for_each_input(foreign, own, [](std::string_view, double from, double& to) { to = from; });
  return own;
}

abs_hil_output foreign_output(const control::SlipOutput& out) noexcept {
  abs_hil_output output{};
  for_each_output(output, out, [](std::string_view, double& to, double from) { to = from; });
  for (std::size_t n = 0; n < rig::signal_max; ++n) output.signals[n] = out.signals[n];
  return output;
}

ForeignController::ForeignController(const std::string& file, const control::ControllerContext& context, Home home)
    : file_(file),
      setup_(setup_of(file, context)),
      fmu_(check(setup_)),
      step_times_(std::make_unique<runtime::LatencyHistogram>()) {
  // What dies while it is made dies there first, and the program refuses the file.
  if (home == Home::this_process) static_cast<void>(HostedCode(setup_));
  code_ = home == Home::own_process ? std::make_unique<HostedCode>(setup_) : load_here(setup_);
  for (const std::string& name : code_->signals()) signals_.push_back({name, "signal of the controller's own"});
  try {
    static_cast<void>(rig::signal_names(signals_));
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(file + ": " + error.what());
  }
}

void ForeignController::reset(const control::SlipInput& input) noexcept {
  time_s_ = 0.0;
  code_->reset(foreign_input(input, 0.0));
}

control::SlipOutput ForeignController::step(const control::SlipInput& input) noexcept {
  time_s_ += input.dt_s;
  abs_hil_output output = no_output();
  runtime::MonotonicClock clock;
  const std::int64_t before_ns = clock.now_ns();
  code_->step(foreign_input(input, time_s_), output);
  step_times_->add(clock.now_ns() - before_ns);
  control::SlipOutput taken{};
  for_each_output(output, taken, [](std::string_view, double from, double& to) { to = from; });
  static_assert(rig::signal_max == ABS_HIL_CONTROLLER_SIGNALS);
  for (std::size_t n = 0; n < signals_.size(); ++n) taken.signals[n] = output.signals[n];
  return taken;
}

ForeignTrial ForeignController::try_out() {
  ForeignTrial trial;
  HostedCode apart(setup_);
  static_cast<void>(apart.warm_up_there(setup_.period_s, trial_steps));
  if (!apart.failure().empty()) throw std::invalid_argument(fmt::format("{}: in a trial {}", file_, apart.failure()));
  trial.offences = apart.probe(setup_.period_s, trial_steps);
  trial.died_without_system = !apart.failure().empty();
  auto* hosted = dynamic_cast<HostedCode*>(code_.get());
  trial.times = hosted != nullptr ? hosted->warm_up_there(setup_.period_s, trial_steps)
                                  : warm_up(*code_, setup_.period_s, trial_steps);
  if (!failure().empty()) throw std::invalid_argument(fmt::format("{}: in a trial {}", file_, failure()));
  // A single late step may be the computer's fault, one of a hundred is the code's own.
  if (static_cast<double>(trial.times.p99_ns) * 1e-9 > setup_.period_s) {
    throw std::invalid_argument(fmt::format(
        "{}: one step of a hundred takes {:.0f} us or more, longer than the control period of {:.0f} us; lower "
        "control.rate_Hz, or make the code faster",
        file_, static_cast<double>(trial.times.p99_ns) * 1e-3, setup_.period_s * 1e6));
  }
  return trial;
}

std::array<control::ControllerFiles, 4> foreign_controllers() noexcept {
  using Made = std::unique_ptr<control::SlipController>;
  const auto make = [](const std::string& file, const control::ControllerContext& context) -> Made {
    return std::make_unique<ForeignController>(file, context, chosen_home.load());
  };
  return {{{".so", make}, {".fmu", make}, {rig::FileEndings::python_class, make}, {".agent", make_agent_controller}}};
}

void register_foreign_controllers() {
  for (const control::ControllerFiles& files : foreign_controllers()) control::register_controller_files(files);
}

void set_home(Home home, bool files_unprotected) noexcept {
  chosen_home.store(home);
  unprotected_accepted.store(files_unprotected);
}

}  // namespace abs_hil::interchange
