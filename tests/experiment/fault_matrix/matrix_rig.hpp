#pragma once

#include <memory>

#include "abs_hil/driver/rig_driver.hpp"
#include "matrix.hpp"

namespace abs_hil::experiment::test {

struct Setup;

/// A backend in this process, on the clock of its driver, and the outputs that act on its wheels.
class MatrixRig {
 public:
  MatrixRig() = default;
  MatrixRig(const MatrixRig&) = delete;
  MatrixRig& operator=(const MatrixRig&) = delete;
  virtual ~MatrixRig() = default;

  /// Returns its driver; call it once. The rig must outlive the driver.
  [[nodiscard]] virtual std::unique_ptr<driver::RigDriver> driver() = 0;
  /// True if neither drive nor brake acts.
  [[nodiscard]] virtual bool at_rest() const = 0;
};

[[nodiscard]] std::unique_ptr<MatrixRig> make_matrix_rig(Backend backend, const Setup& setup);

}  // namespace abs_hil::experiment::test
