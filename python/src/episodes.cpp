// Many simulated rigs, stepped side by side by an agent from outside: what a learning environment is made of.

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "abs_hil/control/slip_controller.hpp"
#include "abs_hil/rig/brake_map.hpp"
#include "array.hpp"
#include "bindings.hpp"
#include "run/parallel.hpp"
#include "run/run.hpp"
#include "study/variation.hpp"

namespace abs_hil::python {

namespace {

using control::SlipInput;
using control::SlipOutput;

/// Longest time until braking begins, in cycles.
constexpr int most_cycles_before_brake = 1'000'000;

/// Gives the agent's torque, or that of a law, and keeps what it was asked with.
class Observed final : public control::SlipController {
 public:
  Observed(std::unique_ptr<control::SlipController> law, double full_torque_Nm)
      : law_(std::move(law)), full_torque_Nm_(full_torque_Nm) {}
  void reset(const SlipInput& input) noexcept override {
    if (law_) law_->reset(input);
  }
  [[nodiscard]] SlipOutput step(const SlipInput& input) noexcept override {
    input_ = input;
    if (std::isinf(input_.max_brake_torque_Nm)) input_.max_brake_torque_Nm = full_torque_Nm_;
    ++calls_;
    if (law_) return law_->step(input);
    return {.brake_torque_Nm = action_ * input_.max_brake_torque_Nm,
            .slip_velocity_error_m_s = rig::unknown,
            .theta_est_N = rig::unknown};
  }
  void set_action(double action) noexcept { action_ = action; }
  [[nodiscard]] const SlipInput& input() const noexcept { return input_; }
  [[nodiscard]] std::int64_t calls() const noexcept { return calls_; }

 private:
  std::unique_ptr<control::SlipController> law_;
  double full_torque_Nm_;
  double action_{0.0};
  SlipInput input_{};
  std::int64_t calls_{0};
};

enum State : int { braking = 0, over = 1, fault = 2 };

/// One braking of one rig, through the program's own cycle.
class Episode {
 public:
  Episode(const config::Settings& settings, const plant_sim::PlantOptions& plant, std::uint64_t seed, bool law)
      : settings_(settings),
        prepared_(settings_),
        run_(prepared_, {.stepped = true,
                         .plant = &plant,
                         .sensor_seed = seed,
                         .controller = [this, law](auto controller) { return observed(std::move(controller), law); }}),
        r2_m_(plant.rig.wheels.r2_m) {
    run_.begin();
    for (int n = 0; n < most_cycles_before_brake && observed_->calls() == 0 && state_ == braking; ++n) cycle();
  }

  /// Runs until the controller was asked `cycles` times more, or until braking is over.
  void step(double action, int cycles) {
    observed_->set_action(action);
    const std::int64_t end = observed_->calls() + cycles;
    while (state_ == braking && observed_->calls() < end) cycle();
  }
  static constexpr std::size_t value_count = 13;
  [[nodiscard]] std::array<double, value_count> values() const noexcept {
    const SlipInput& i = observed_->input();
    const rig::CycleRecord& r = run_.latest();
    return {i.slip,
            i.slip_ref,
            settings_.model.wheels.r2_m * i.speeds.omega2_rad_s,
            i.alpha1_rad_s2,
            i.alpha2_rad_s2,
            i.brake_torque_Nm,
            i.max_brake_torque_Nm,
            i.speeds.omega1_rad_s,
            r.truth.slip,
            r2_m_ * r.truth.speeds.omega2_rad_s,
            r.control.brake_torque_ref_Nm,
            r.time_s,
            static_cast<double>(state_)};
  }

 private:
  std::unique_ptr<control::SlipController> observed(std::unique_ptr<control::SlipController> controller, bool law) {
    auto observed = std::make_unique<Observed>(law ? std::move(controller) : nullptr,
                                               rig::brake_torque_at(settings_.model.brake, 1.0));
    observed_ = observed.get();
    return observed;
  }
  void cycle() {
    const bool running = run_.cycle();
    const rig::Phase phase = run_.latest().phase;
    const bool has_braked = observed_->calls() > 0 && phase != rig::Phase::brake;
    if (phase == rig::Phase::fault || rig::is_fault(run_.end_reason())) {
      state_ = fault;
    } else if (!running || has_braked) {
      state_ = over;
    }
  }

  config::Settings settings_;
  Observed* observed_{nullptr};
  run::Prepared prepared_;
  run::Run run_;
  double r2_m_;
  State state_{braking};
};

using Values = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// Several rigs, each in an episode of its own.
class Episodes {
 public:
  Episodes(std::size_t rigs, std::size_t threads)
      : episodes_(rigs), threads_(threads > 0 ? threads : run::machine_threads()) {}

  /// Begins a new episode of one rig. @param vary  what varies, by plant `index` of the series `seed`
  void reset(std::size_t rig, const py::dict& arguments, const std::string& vary, std::uint64_t seed,
             std::uint64_t index, bool law) {
    const config::Sources options = run_options(arguments);
    const py::gil_scoped_release release;
    const config::Configuration request = config::merge(options);
    const study::Perturbation drawn = study::draw(study::Variation::parse(vary), seed, index);
    episodes_.at(rig) = std::make_unique<Episode>(request.settings, study::perturbed(request.settings.plant, drawn),
                                                  drawn.sensor_seed, law);
  }
  /// Steps every rig under its action, in [0, 1], for `cycles` control periods.
  void step(const Values& actions, int cycles) {
    if (actions.ndim() != 1 || static_cast<std::size_t>(actions.size()) != episodes_.size()) {
      throw std::invalid_argument("actions: give one number for each rig");
    }
    const double* action = actions.data();
    const py::gil_scoped_release release;
    run::for_each_index(episodes_.size(), threads_, [&](std::size_t i) { at(i).step(action[i], cycles); });
  }
  /// Steps one rig through the actions, for `cycles` control periods each.
  void replay(std::size_t rig, const Values& actions, int cycles) {
    const double* action = actions.data();
    const py::gil_scoped_release release;
    for (py::ssize_t i = 0; i < actions.size(); ++i) at(rig).step(action[i], cycles);
  }
  /// Shape (rigs, values).
  [[nodiscard]] py::array_t<double> values() {
    auto all = new_array<py::array_t<double>>(
        {static_cast<py::ssize_t>(episodes_.size()), static_cast<py::ssize_t>(Episode::value_count)});
    for (std::size_t i = 0; i < episodes_.size(); ++i) {
      const auto values = at(i).values();
      std::copy(values.begin(), values.end(), all.mutable_data(static_cast<py::ssize_t>(i), 0));
    }
    return all;
  }

 private:
  Episode& at(std::size_t rig) {
    if (!episodes_[rig]) throw std::invalid_argument("rig " + std::to_string(rig) + ": reset it before a step");
    return *episodes_[rig];
  }

  std::vector<std::unique_ptr<Episode>> episodes_;
  std::size_t threads_;
};

}  // namespace

void add_episodes(py::module_& module) {
  py::class_<Episodes>(module, "Episodes")
      .def(py::init<std::size_t, std::size_t>(), py::arg("rigs"), py::arg("threads"))
      .def("reset", &Episodes::reset, py::arg("rig"), py::arg("options"), py::arg("vary"), py::arg("seed"),
           py::arg("index"), py::arg("law"))
      .def("step", &Episodes::step, py::arg("actions"), py::arg("cycles"))
      .def("replay", &Episodes::replay, py::arg("rig"), py::arg("actions"), py::arg("cycles"))
      .def("values", &Episodes::values);
}

}  // namespace abs_hil::python
