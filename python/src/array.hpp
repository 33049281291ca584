#pragma once

#include <pybind11/numpy.h>

#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "bindings.hpp"

namespace abs_hil::python {

template <class Value>
py::object array_of(std::vector<Value> values) {
  auto kept = std::make_unique<std::vector<Value>>(std::move(values));
  Value* const data = kept->data();
  const std::array size{static_cast<py::ssize_t>(kept->size())};
  // Debian's pybind11 2.10 reads a wrong size of an element from NumPy 2: every row would be the first one.
  const std::array stride{static_cast<py::ssize_t>(sizeof(Value))};
  const py::capsule owner(kept.release(), [](void* owned) { delete static_cast<std::vector<Value>*>(owned); });
  return py::array_t<Value>(size, stride, data, owner);
}

}  // namespace abs_hil::python
