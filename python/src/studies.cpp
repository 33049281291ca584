// Studies: the engine of `abs_hil study`, and the options of one of a study's runs.

#include <pybind11/functional.h>
#include <pybind11/stl.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>

#include "bindings.hpp"
#include "config/config_error.hpp"
#include "program/study_runs.hpp"
#include "study/compute.hpp"
#include "study/gzip.hpp"
#include "study/parallel.hpp"
#include "study/study_folder.hpp"

namespace abs_hil::python {

namespace {

/// As `abs_hil study FILE --out FOLDER --shard NUMBER/OF`. Returns the number of runs that it computed.
std::uint64_t run_study(const std::string& file, const std::string& name, const std::string& folder,
                        std::uint64_t number, std::uint64_t of, std::size_t threads,
                        const std::function<void(std::uint64_t, std::uint64_t)>& progress) {
  const py::gil_scoped_release release;
  const study::Study study = program::make_study(study::load_study(file));
  const study::StudyFolder results(folder, study::facts_of(study, name));
  const std::vector<std::uint64_t> chunks = study::missing_chunks(results, {.number = number, .of = of});
  std::uint64_t runs = 0;
  for (const std::uint64_t chunk : chunks) runs += study.runs_in(chunk);
  const std::uint64_t step = std::max<std::uint64_t>(1, runs / 100);
  if (threads == 0) threads = study::machine_threads();
  const study::Tally tally =
      study::compute(study, results, chunks, threads, program::own_metrics, [&](std::uint64_t done) {
        if (done % step != 0 && done != runs) return;
        const py::gil_scoped_acquire gil;
        if (PyErr_CheckSignals() != 0) throw py::error_already_set();
        if (progress) progress(done, runs);
      });
  if (of == 1) results.merge({});
  return tally.runs;
}

/// The arguments of abs_hil.simulate that repeat a run.
py::dict run_of_study(const std::string& file, std::uint64_t number) {
  const study::Study study = program::make_study(study::load_study(file));
  const program::RunOptions options = program::options_of_run(study, number);
  py::dict arguments;
  arguments["plant"] = options.plant.value_or("");
  arguments["experiment"] = options.experiment.value_or("");
  if (options.model) arguments["model"] = *options.model;
  arguments["set"] = options.assignments;
  return arguments;
}

/// The facts of a study, as JSON: the comment of the first member of its results.
std::string facts_of_results(const py::bytes& first_bytes) {
  const std::string_view bytes = first_bytes;
  return study::gzip_comment(bytes);
}

}  // namespace

void add_studies(py::module_& module) {
  module.def("run_study", &run_study, py::arg("file"), py::arg("name"), py::arg("folder"), py::arg("number"),
             py::arg("of"), py::arg("threads"), py::arg("progress") = nullptr);
  module.def("run_of_study", &run_of_study, py::arg("file"), py::arg("number"));
  module.def("facts_of_results", &facts_of_results, py::arg("first_bytes"));
}

}  // namespace abs_hil::python
