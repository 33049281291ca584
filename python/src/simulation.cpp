// Whole runs in virtual time: one with its records, or many with their figures of merit.

#include <pybind11/stl.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <exception>
#include <map>
#include <optional>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "analysis/run_summary.hpp"
#include "array.hpp"
#include "bindings.hpp"
#include "column_sink.hpp"
#include "config/config_error.hpp"
#include "interruptible.hpp"
#include "run/parallel.hpp"
#include "run/run.hpp"
#include "study/batch.hpp"
#include "study/variation.hpp"

namespace abs_hil::python {

namespace {

/// Ends a run if Ctrl-C was pressed, or if its controller in Python failed.
class PythonPoll {
 public:
  explicit PythonPoll(const PythonControllerScope* scope) : scope_(scope) {}
  rig::Reason operator()() {
    const py::gil_scoped_acquire gil;
    if (!interrupted_ && PyErr_CheckSignals() != 0) {
      error_.emplace();
      interrupted_ = true;
    }
    if (interrupted_ || (scope_ != nullptr && scope_->failed())) return rig::Reason::interrupt_signal;
    return rig::Reason::none;
  }
  void rethrow() {
    if (error_) throw std::move(*error_);
  }

 private:
  const PythonControllerScope* scope_;
  std::optional<py::error_already_set> error_;
  bool interrupted_{false};
};

/// The request with the plant number `index` that `abs_hil compare` draws. The model stays.
config::Configuration on_varied_plant(config::Settings settings, const std::string& vary, std::uint64_t seed,
                                      std::uint64_t index) {
  const study::Perturbation drawn = study::draw(study::Variation::parse(vary), seed, index);
  settings.plant = study::perturbed(settings.plant, drawn);
  settings.sensor_seed = std::to_string(drawn.sensor_seed);
  return config::configuration_of(std::move(settings));
}

/// @param varied  what varies, the seed of the plants and the number of one: a run on that plant
py::tuple simulate(const py::dict& arguments, py::object controller,
                   const std::optional<std::tuple<std::string, std::uint64_t, std::uint64_t>>& varied) {
  config::Sources options = run_options(arguments);
  std::optional<PythonControllerScope> scope;
  if (!controller.is_none()) {
    scope.emplace(std::move(controller));
    options.controller = python_controller;
  }
  return recorded_run(
      [&] {
        if (!varied) return config::merge(options);
        const auto& [vary, seed, index] = *varied;
        return on_varied_plant(config::merged_settings(options), vary, seed, index);
      },
      scope ? &*scope : nullptr);
}

/// Of many runs one: the index of its options, and the number of the plant that `abs_hil compare` draws for it.
using OneRun = std::pair<std::size_t, std::optional<std::uint64_t>>;

/// Why the options cannot be used; empty if they can.
template <class Work>
std::string refusal(const Work& work) {
  try {
    work();
  } catch (const config::ConfigError& error) {
    return error.what();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return {};
}

/// Runs one job whose controller is a Python object, in this thread. Returns why its options cannot be used, and throws
/// what the controller raised. Called without Python's lock.
std::string run_with_law(const py::object& law, config::Sources options,
                         const std::function<study::Job(const config::Settings&)>& job_of, study::RunResult& result) {
  std::optional<PythonControllerScope> scope;
  const auto locked = [](const auto& work) {
    const py::gil_scoped_acquire gil;
    work();
  };
  locked([&] { scope.emplace(law); });
  options.controller = python_controller;
  std::string unusable = refusal([&] {
    const config::Settings settings = config::merged_settings(options);
    const study::Job job = job_of(settings);
    result = study::simulate(run::Prepared(settings), job.plant, job.seed);
  });
  locked([&] {
    const std::exception_ptr raised = scope->raised();
    scope.reset();
    if (raised) std::rethrow_exception(raised);
  });
  return unusable;
}

/// @param jobs  pairs (index into `options`, index of the perturbation or None)
/// @param laws  of each of the options the controller's object, or None for one of the program's
py::dict simulate_many(const std::vector<py::dict>& options, const std::vector<OneRun>& jobs, const std::string& vary,
                       std::uint64_t seed, std::size_t threads, Interruptible::Progress progress,
                       const std::vector<py::object>& laws) {
  const study::Variation variation = study::Variation::parse(vary);
  std::vector<config::Sources> typed;
  for (const py::dict& arguments : options) typed.push_back(run_options(arguments));
  std::vector<bool> in_python;
  for (const py::object& law : laws) in_python.push_back(!law.is_none());
  std::vector<study::RunResult> results(jobs.size());
  std::vector<std::string> errors(jobs.size());
  Interruptible loop(std::move(progress));
  loop.run([&] {
    if (threads == 0) threads = run::machine_threads();
    std::vector<config::Settings> settings(typed.size());
    std::vector<std::string> unusable(typed.size());
    run::for_each_index(typed.size(), threads, [&](std::size_t i) {
      if (!in_python[i]) unusable[i] = refusal([&] { settings[i] = config::merged_settings(typed[i]); });
      loop.after(0, jobs.size());
    });
    std::atomic<std::size_t> finished{0};
    std::vector<std::size_t> usable;
    for (std::size_t i = 0; i < jobs.size(); ++i) {
      errors[i] = unusable[jobs[i].first];
      if (errors[i].empty() && !in_python[jobs[i].first]) usable.push_back(i);
    }
    const std::size_t others =
        static_cast<std::size_t>(std::ranges::count_if(jobs, [&](const OneRun& job) { return in_python[job.first]; }));
    const auto on_plant = [&](const config::Settings& s, const std::optional<std::uint64_t>& plant) -> study::Job {
      if (!plant) return {.settings = &s, .plant = s.plant, .seed = config::sensor_seed(s)};
      const study::Perturbation drawn = study::draw(variation, seed, *plant);
      return {.settings = &s, .plant = study::perturbed(s.plant, drawn), .seed = drawn.sensor_seed};
    };
    const study::JobSource job_of = [&](std::size_t k) {
      const auto& [at, plant] = jobs[usable[k]];
      return on_plant(settings[at], plant);
    };
    study::run_batch(usable.size(), threads, job_of, [&](std::size_t k, study::Outcome outcome) {
      results[usable[k]] = outcome.run;
      errors[usable[k]] = std::move(outcome.refusal);
      const std::size_t done = finished.fetch_add(1) + 1;
      loop.after(jobs.size() - others - usable.size() + done, jobs.size());
    });
    std::size_t left = others;
    for (std::size_t i = 0; i < jobs.size() && left > 0; ++i) {
      const auto& [at, plant] = jobs[i];
      if (!in_python[at]) continue;
      errors[i] = run_with_law(
          laws[at], typed[at], [&on_plant, &plant = plant](const config::Settings& s) { return on_plant(s, plant); },
          results[i]);
      loop.after(jobs.size() - --left, jobs.size());
    }
  });
  py::dict columns;
  const auto add = [&](const char* name, auto&& value) {
    std::vector<double> values;
    values.reserve(results.size());
    for (const study::RunResult& result : results) values.push_back(value(result));
    columns[name] = array_of(std::move(values));
  };
  for (const analysis::Figure& figure : analysis::figures) {
    add(std::string(figure.name).c_str(), [&](const study::RunResult& r) { return figure.of(r.metrics); });
  }
  std::vector<std::string> faults;
  faults.reserve(results.size());
  for (const study::RunResult& result : results) {
    faults.emplace_back(result.stopped() ? std::string_view() : rig::row_of(result.fault).name);
  }
  columns["fault"] = faults;
  columns["error"] = errors;
  return columns;
}

/// The runs of a series in its order: for each its varied values as JSON, its seed, and what `simulate` returns. All
/// configurations are checked before the first run.
py::list simulate_series(const py::dict& arguments) {
  const config::Sources common = run_options(arguments);
  const config::Configuration base = config::merge(common);
  const std::vector<config::SeriesMember> members = config::members_of(*base.script, base.settings.seed);
  std::vector<config::Configuration> requests;
  for (const config::SeriesMember& member : members) {
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    config::Sources one = common;
    config::choose(member, one);
    requests.push_back(config::merge(one));
    if (!base.script->series.experiments.empty()) config::refuse_nested(*base.script, *requests.back().script);
  }
  py::list runs;
  for (std::size_t n = 0; n < members.size(); ++n) {
    const py::tuple run = recorded_run([&] { return std::move(requests[n]); }, nullptr);
    runs.append(py::make_tuple(config::varied_json(members[n]).dump(), members[n].seed, run));
  }
  return runs;
}

std::vector<std::string> texts(const py::handle& values) { return py::cast<std::vector<std::string>>(values); }

}  // namespace

py::tuple recorded_run(const std::function<config::Configuration()>& request, PythonControllerScope* scope) {
  ColumnSink columns;
  run::Simulation simulation;
  std::string config_toml;
  PythonPoll poll(scope);
  {
    const py::gil_scoped_release release;
    config::Configuration made = request();
    simulation = run::simulate(made.settings, *made.script, {&columns}, std::ref(poll));
    simulation.summary.config = nlohmann::ordered_json::parse(made.json);
    config_toml = std::move(made.toml);
  }
  poll.rethrow();
  if (scope != nullptr) scope->rethrow();
  return py::make_tuple(columns.take(simulation.names), simulation.names.signals, to_json(simulation.summary).dump(),
                        config_toml);
}

config::Sources run_options(const py::dict& arguments) {
  config::Sources options;
  const std::map<std::string, std::optional<std::string>*> named{
      {"plant", &options.plant},           {"model", &options.model},        {"controller", &options.controller},
      {"experiment", &options.experiment}, {"config", &options.config_file}, {"seed", &options.seed}};
  for (const auto& [key, value] : arguments) {
    const auto name = py::cast<std::string>(key);
    if (name == "set") {
      options.assignments = texts(value);
    } else if (name == "inject") {
      options.injections = texts(value);
    } else if (const auto found = named.find(name); found != named.end()) {
      *found->second = py::cast<std::string>(value);
    } else {
      throw std::invalid_argument("unknown option " + name);
    }
  }
  options.virtual_time = true;
  return options;
}

void add_simulation(py::module_& module) {
  module.def("simulate", &simulate, py::arg("options"), py::arg("controller") = py::none(),
             py::arg("varied") = py::none());
  module.def("simulate_series", &simulate_series, py::arg("options"));
  module.def("simulate_many", &simulate_many, py::arg("options"), py::arg("jobs"), py::arg("vary"), py::arg("seed"),
             py::arg("threads"), py::arg("progress"), py::arg("laws"));
}

}  // namespace abs_hil::python
