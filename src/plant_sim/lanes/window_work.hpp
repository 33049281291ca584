// What the compiled kernels of windows take, one for each instruction set.
#pragma once

#include <cstddef>

#include "rig/instruction_sets.hpp"

/// Plants of other parameters or states that pass the same inputs side by side: what differences of simulations are
/// made of. Compiled for each instruction set, as the lanes of a study are.
namespace abs_hil::plant_sim::lanes {

/// Inputs over one interval. A lane whose inputs come late has the earlier ones until then.
struct Interval {
  double duration_s{0.0};
  double motor_duty{0.0};
  double brake_duty{0.0};
  double earlier_motor_duty{0.0};
  double earlier_brake_duty{0.0};
};

/// One window and the plants that pass it. Lane n has column n of every array; each array has `lanes` columns.
struct WindowWork {
  double* const* plants{nullptr};  ///< words of a LanePlant<double>, at its start state; they stay as they are
  std::size_t count{0};            ///< of plants: `lanes` at most
  const Interval* intervals{nullptr};
  std::size_t rows{0};
  bool apart{false};        ///< the wheels do not touch
  bool late{false};         ///< a lane's inputs come late
  double* angles{nullptr};  ///< (rows, 2, lanes): upper and lower wheel at the start of each interval
  double* ends{nullptr};    ///< (5, lanes): the states at the window's end, as StateVector
};

/// Integrates every plant over the window. False where a wheel stands or stops, which lanes cannot do: the arrays are
/// wrong then. While the wheels are apart the upper one may stand from the start.
struct WindowKernel {
  bool (*pass)(const WindowWork& work) noexcept;
  std::size_t lanes;
};

template <template <class> class Tyre, template <class> class Load>
struct WindowKind;

/// Defined in the sources that are compiled for `Isa` alone.
template <class Isa, class Kind>
WindowKernel window_kernel() noexcept;

}  // namespace abs_hil::plant_sim::lanes
