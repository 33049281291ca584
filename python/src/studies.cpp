// Studies as `abs_hil study` computes them, and single runs of them.

#include <pybind11/stl.h>

#include <cstdint>
#include <string>
#include <utility>

#include "bindings.hpp"
#include "interruptible.hpp"
#include "study/compute.hpp"
#include "study/study_folder.hpp"

namespace abs_hil::python {

namespace {

/// study::run. Returns the number of runs that it computed.
std::uint64_t run_study(const std::string& file, const std::string& folder, const std::string& name,
                        std::size_t threads, Interruptible::Progress progress) {
  Interruptible loop(std::move(progress));
  std::uint64_t runs = 0;
  loop.run([&] {
    runs = study::run(file, folder, {.threads = threads, .name = name}, [&loop](std::uint64_t done, std::uint64_t all) {
             loop.after(done, all);
           }).runs;
  });
  return runs;
}

/// What abs_hil.simulate returns, for a run of a study.
py::tuple simulate_run(const std::string& file, std::uint64_t number) {
  return recorded_run(
      [&] {
        const study::Study study = study::make_study(study::load_study(file));
        return config::configuration_of(study::settings_of_run(study, number));
      },
      nullptr);
}

/// The facts of a study, as JSON: the note of the first member of its results.
std::string facts_of_results(const py::bytes& first_bytes) {
  const std::string_view bytes = first_bytes;
  return study::gzip_note(bytes);
}

}  // namespace

void add_studies(py::module_& module) {
  module.def("run_study", &run_study, py::arg("file"), py::arg("folder"), py::arg("name"), py::arg("threads"),
             py::arg("progress") = nullptr);
  module.def("simulate_run", &simulate_run, py::arg("file"), py::arg("number"));
  module.def("facts_of_results", &facts_of_results, py::arg("first_bytes"));
}

}  // namespace abs_hil::python
