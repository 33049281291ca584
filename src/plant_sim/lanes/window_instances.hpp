#pragma once

// The kernels of one instruction set. A source defines ABS_HIL_LANE_ISA and ABS_HIL_LANE_VECTORS and includes this; it
// is compiled for that set alone, so it must define no function that other sources define too:
// tests/study/lanes/symbols_test.py checks the names.
#include "plant_sim/lanes/lane_plant.hpp"
#include "rig/pack.hpp"

namespace abs_hil::plant_sim::lanes {

template <class Isa, std::size_t Vectors, template <class> class Tyre, template <class> class Load>
bool pass_window(const WindowWork& work) noexcept {
  using S = rig::Pack<Isa, Vectors>;
  using Plant = LanePlant<S, Tyre<S>, Load<S>>;
  using One = LanePlant<double, Tyre<double>, Load<double>>;
  static_assert(sizeof(Plant) == sizeof(One) * S::lanes, "plant and lane have the same words");
  static_assert(std::is_trivially_copyable_v<Plant> && std::is_trivially_copyable_v<One>);
  Plant plants;
  for (std::size_t lane = 0; lane < S::lanes; ++lane)  // free lanes repeat the first plant
    rig::put_lane<S>(plants, lane, work.plants[lane < work.count ? lane : 0]);
  WindowPass<S, Tyre<S>, Load<S>> pass(plants);
  constexpr std::size_t bytes = sizeof(S);
  for (std::size_t row = 0; row < work.rows; ++row) {
    double* const to = work.angles + 2 * row * S::lanes;
    std::memcpy(to, &pass.x()[angle1], bytes);
    std::memcpy(to + S::lanes, &pass.x()[angle2], bytes);
    if (rig::any(pass.advance(work.intervals[row], work.apart, work.late))) return false;
  }
  for (std::size_t i = 0; i < pass.x().size(); ++i) std::memcpy(work.ends + i * S::lanes, &pass.x()[i], bytes);
  return true;
}

#define ABS_HIL_WINDOW_KERNEL(tyre, load)                                                     \
  template <>                                                                                 \
  WindowKernel window_kernel<rig::ABS_HIL_LANE_ISA, WindowKind<tyre, load>>() noexcept {      \
    using S = rig::Pack<rig::ABS_HIL_LANE_ISA, ABS_HIL_LANE_VECTORS>;                         \
    return {&pass_window<rig::ABS_HIL_LANE_ISA, ABS_HIL_LANE_VECTORS, tyre, load>, S::lanes}; \
  }
ABS_HIL_WINDOW_KINDS(ABS_HIL_WINDOW_KERNEL)
#undef ABS_HIL_WINDOW_KERNEL

}  // namespace abs_hil::plant_sim::lanes
