#pragma once

#include <pybind11/numpy.h>

#include <memory>
#include <utility>
#include <vector>

#include "bindings.hpp"

namespace abs_hil::python {

template <class Value>
py::object array_of(std::vector<Value> values) {
  auto kept = std::make_unique<std::vector<Value>>(std::move(values));
  Value* const data = kept->data();
  const auto size = static_cast<py::ssize_t>(kept->size());
  const py::capsule owner(kept.release(), [](void* owned) { delete static_cast<std::vector<Value>*>(owned); });
  return py::array_t<Value>(size, data, owner);
}

}  // namespace abs_hil::python
