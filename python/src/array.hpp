#pragma once

#include <pybind11/numpy.h>

#include <array>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "bindings.hpp"

namespace abs_hil::python {

// Debian's pybind11 2.10 reads a wrong size of an element from NumPy 2: every row of an array without strides would be
// the first one.

/// An array of this shape, in C order, whose elements are not set.
template <class Array>
Array new_array(std::vector<py::ssize_t> shape) {
  std::vector<py::ssize_t> strides(shape.size(), sizeof(typename Array::value_type));
  for (std::size_t i = shape.size() - 1; i > 0; --i) strides[i - 1] = strides[i] * shape[i];
  return Array(std::move(shape), std::move(strides));
}

template <class Value>
py::object array_of(std::vector<Value> values) {
  auto kept = std::make_unique<std::vector<Value>>(std::move(values));
  Value* const data = kept->data();
  const std::array size{static_cast<py::ssize_t>(kept->size())};
  const std::array stride{static_cast<py::ssize_t>(sizeof(Value))};
  const py::capsule owner(kept.release(), [](void* owned) { delete static_cast<std::vector<Value>*>(owned); });
  return py::array_t<Value>(size, stride, data, owner);
}

}  // namespace abs_hil::python
