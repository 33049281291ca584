// SHA-256 by Python's hashlib: the simulation core links no library that has one.
#include "run_folder/sha256.hpp"

#include <pybind11/pybind11.h>

namespace abs_hil::run_folder {

namespace py = pybind11;

/// Its functions may be called with and without the interpreter's lock.
struct Sha256::State {
  py::object hash{py::module_::import("hashlib").attr("sha256")()};
};

Sha256::Sha256() {
  const py::gil_scoped_acquire gil;
  state_ = std::make_unique<State>();
}

Sha256::~Sha256() {
  const py::gil_scoped_acquire gil;
  state_.reset();
}

void Sha256::add(std::string_view bytes) {
  const py::gil_scoped_acquire gil;
  state_->hash.attr("update")(py::memoryview::from_memory(bytes.data(), static_cast<py::ssize_t>(bytes.size())));
}

std::string Sha256::hex() {
  const py::gil_scoped_acquire gil;
  return state_->hash.attr("hexdigest")().cast<std::string>();
}

}  // namespace abs_hil::run_folder
