// Plants side by side in lanes that pass the inputs of a recorded window.
#pragma once

#include <cstddef>

#include "abs_hil/plant_sim/load_models.hpp"
#include "abs_hil/plant_sim/tyre_models.hpp"
#include "plant_sim/runge_kutta.hpp"
#include "rig/instruction_sets.hpp"
#include "rig/pack.hpp"

/// Calls `each(tyre, load)` for every combination that has lanes.
#define ABS_HIL_WINDOW_KINDS(each)                                 \
  each(plant_sim::BasicMagicFormula, plant_sim::BasicConstantLoad) \
      each(plant_sim::BasicIntecoMu, plant_sim::BasicLeverLoad)

/// Plants of other parameters, states or duties that pass the same window side by side: what differences of simulations
/// are made of. Compiled for each instruction set, as the lanes of a study are.
namespace abs_hil::python::lanes {

using namespace plant_sim;

/// The duties of one interval, a vector of lanes each. A lane whose inputs come late has the earlier ones until then.
enum Duty : std::size_t { motor_duty, brake_duty, earlier_motor_duty, earlier_brake_duty, duties };

/// One window and the plants that pass it. Lane n has column n of every array; each array has `lanes` columns.
struct WindowWork {
  double* const* plants{nullptr};      ///< words of a LanePlant<double>, at its start state; they stay as they are
  std::size_t count{0};                ///< of plants: `lanes` at most
  const double* durations_s{nullptr};  ///< (rows)
  const double* inputs{nullptr};       ///< (rows, duties, lanes)
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

/// A plant without profiles and flaws, over a scalar. It has nothing but scalars as members, so that plant and lane
/// have the same words (rig/pack.hpp).
template <class S, class Tyre, class Load>
struct LanePlant {
  Tyre tyre{};
  Load load{};
  BasicWheels<S> wheels{};
  rig::BasicBrake<S> brake{};
  S brake_limit_Nm_s{std::numeric_limits<double>::infinity()};
  S brake_release_ratio{1.0};
  S motor_stall_Nm{0.0};
  S motor_no_load_rad_s{1.0};
  S max_step_s{0.0};
  S delay_s{0.0};
  S upper_turns{1.0};  ///< 0: the upper wheel stands; for wheels apart
  BasicState<S> x{};
};

/// The right-hand side of (1), (2) and (6) for wheels apart that turn forwards, the upper one unless it stands.
template <class S>
struct ApartBalance {
  const BasicWheels<S>& wheels;
  const BasicHeldTorques<S>& held;
  const S& upper_turns;

  [[nodiscard, gnu::always_inline]] BasicState<S> operator()(const BasicState<S>& x,
                                                             const S& /*time_s*/) const noexcept {
    BasicState<S> rates = rates_of(wheels, held, S(0.0), Forwards{}, Forwards{}, x);
    rates[omega1] = rates[omega1] * upper_turns;
    return rates;
  }
};

template <class S, class Tyre, class Load>
class WindowPass {
 public:
  using Plant = LanePlant<S, Tyre, Load>;

  explicit WindowPass(const Plant& plant) noexcept : plant_(plant) {}

  /// Over one interval. True where a wheel stands or stops.
  [[gnu::always_inline]] auto advance(double duration_s, const S* duty, bool apart, bool late) noexcept {
    const S whole_s(duration_s);
    const auto same = duty[earlier_motor_duty] == duty[motor_duty] && duty[earlier_brake_duty] == duty[brake_duty];
    if (!late || !rig::any(!same)) return advance_part(whole_s, duty[motor_duty], duty[brake_duty], apart);
    const S late_s = rig::smaller(plant_.delay_s, whole_s);
    const auto before = advance_part(late_s, duty[earlier_motor_duty], duty[earlier_brake_duty], apart);
    return before || advance_part(S(whole_s - late_s), duty[motor_duty], duty[brake_duty], apart);
  }
  [[nodiscard]] const BasicState<S>& x() const noexcept { return plant_.x; }

 private:
  [[gnu::noinline, gnu::flatten]] auto advance_part(const S& duration_s, const S& motor, const S& brake,
                                                    bool apart) noexcept {
    BasicHeldTorques<S> held;
    held.brake_target_Nm = rig::brake_torque_at(plant_.brake, brake);
    held.brake_rate_per_s = plant_.brake.c31_per_s * rig::select(held.brake_target_Nm < plant_.x[brake_torque],
                                                                 plant_.brake_release_ratio, S(1.0));
    held.brake_limit_Nm_s = plant_.brake_limit_Nm_s;
    held.motor_stall_Nm = plant_.motor_stall_Nm * motor;
    held.motor_back_emf_Nms = held.motor_stall_Nm / plant_.motor_no_load_rad_s;
    if (apart) {
      const ApartBalance<S> balance{plant_.wheels, held, plant_.upper_turns};
      return go_on(balance, steps_for(duration_s, plant_.max_step_s, S(0.0)), duration_s);
    }
    const S friction(1.0);
    const RollingBalance<S, Tyre, Load, BasicHeldTorques<S>> balance{plant_.tyre, plant_.load, plant_.wheels, held,
                                                                     friction};
    return go_on(balance, steps_for(duration_s, plant_.max_step_s, balance.fastest_rate_per_s(plant_.x)), duration_s);
  }
  template <class Balance>
  [[gnu::always_inline]] auto go_on(const Balance& balance, const S& steps, const S& duration_s) noexcept {
    const auto where = turns(plant_.x);
    const auto turning = [this](const BasicState<S>& end) { return turns(end); };
    return !(where && steps_made(balance, steps, S(duration_s / steps), where, plant_.x, turning) == steps);
  }
  [[nodiscard, gnu::always_inline]] auto turns(const BasicState<S>& x) const noexcept {
    return (x[omega1] > 0.0 || plant_.upper_turns == S(0.0)) && x[omega2] > 0.0;
  }

  Plant plant_;
};

#ifdef ABS_HIL_LANE_ISA
// The kernels of one instruction set. A source defines ABS_HIL_LANE_ISA and ABS_HIL_LANE_VECTORS and includes this; it
// is compiled for that set alone, so it must define no function that other sources define too:
// tests/study/lanes/symbols_test.py checks the names.
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
    S duty[duties];
    std::memcpy(duty, work.inputs + row * duties * S::lanes, sizeof duty);
    if (rig::any(pass.advance(work.durations_s[row], duty, work.apart, work.late))) return false;
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
#endif

}  // namespace abs_hil::python::lanes
