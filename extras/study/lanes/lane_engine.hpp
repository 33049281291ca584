// Fills the lanes of a pack with runs and steps them until each is complete or disturbed.
#pragma once

#include <bit>
#include <cstddef>
#include <cstring>
#include <new>

#include "rig/pack.hpp"
#include "study/lanes/braking_run.hpp"
#include "study/lanes/lane_kinds.hpp"

namespace abs_hil::study::lanes {

/// Runs all of `work` in the lanes of `Run`. The number of integration steps that a run needs for a cycle rises as the
/// car slows down, and the lanes of a pack take as many steps as the neediest. So runs go on among their like: one that
/// needs more than its class allows is parked until the runs of that class have passed. The law is behind a pointer, so
/// that the compiler meets the engine once a rig and not once a law.
template <class Course>
class LaneEngine {
 public:
  using S = typename Course::Scalar;

  /// A law in lanes: its words stand behind those of the course.
  struct PackedLaw {
    void* law;
    control::BasicSlipOutput<S> (*answer)(void* law, const control::BasicSlipInput<S>& input) noexcept;
    bool estimates_theta;
    std::size_t run_words;  ///< of one run: course and law
  };

  LaneEngine(const LaneWork& work, Course& packed, const PackedLaw& law) noexcept
      : work_(work), packed_(packed), law_(law) {
    for (std::uint32_t& head : heads_) head = none;
    for (std::uint32_t i = work.count; i-- > 0;) park(i, 0);
  }

  void run() noexcept {
    for (std::uint32_t level = 0; level < levels; ++level) {
      const double most_steps = level_steps[level];
      while (fill(level)) {
        for (std::uint32_t c = 1; c <= work_.window_cycles; ++c) {
          packed_.cycle(
              c == work_.window_cycles,
              [this](const auto& where, const auto& before) { assist(active_ & lane_bits(where), before); },
              [this](const auto& input) { return law_.answer(law_.law, input); }, law_.estimates_theta);
          // Later cycles would change the figures of a complete run.
          const std::uint32_t ended = active_ & lane_bits(packed_.complete + packed_.disturbed > S(0.0));
          if (ended != 0) store(ended);
        }
        const std::uint32_t needy = active_ & lane_bits(packed_.rig.steps > S(most_steps));
        if (needy == 0) continue;
        store(needy);
        for (std::uint32_t left = needy; left != 0; left &= left - 1) {
          park(runs_[static_cast<std::uint32_t>(std::countr_zero(left))], level + 1);
        }
      }
    }
  }

 private:
  static constexpr std::uint32_t none = 0xffffffff;
  static constexpr std::uint32_t levels = 9;
  static constexpr double level_steps[levels]{2, 3, 4, 6, 8, 12, 16, 24, 1e300};  ///< most steps a cycle

  void park(std::uint32_t run, std::uint32_t level) noexcept {
    work_.next[run] = heads_[level];
    heads_[level] = run;
  }
  /// Fills free lanes with parked runs, or with copies of others, which nobody looks at. False if there is none.
  bool fill(std::uint32_t level) noexcept {
    const std::uint32_t all = S::lanes == 32 ? ~0U : (1U << S::lanes) - 1U;
    std::uint32_t free = all & ~active_;
    if (free == 0) return true;
    while (free != 0 && heads_[level] != none) {
      const auto lane = static_cast<std::uint32_t>(std::countr_zero(free));
      const std::uint32_t run = heads_[level];
      heads_[level] = work_.next[run];
      runs_[lane] = run;
      rig::put_lane<S>(&packed_, law_.run_words, lane, work_.runs[run]);
      active_ |= 1U << lane;
      free &= free - 1;
    }
    if (active_ == 0) return false;
    if (free == 0) return true;
    // A copy takes as many steps as its original while both go on. Where it ends or gets needy, it is renewed.
    const std::uint32_t stale = free & (~copies_ | lane_bits(packed_.complete + packed_.disturbed > S(0.0)) |
                                        lane_bits(packed_.rig.steps > S(level_steps[level])));
    copies_ = free;
    for (std::uint32_t left = stale; left != 0; left &= left - 1) {
      const auto original = static_cast<std::size_t>(std::countr_zero(active_));
      const auto copy = static_cast<std::size_t>(std::countr_zero(left));
      auto* word = reinterpret_cast<unsigned char*>(&packed_);
      for (std::size_t i = 0; i < law_.run_words; ++i, word += sizeof(S))
        std::memcpy(word + copy * sizeof(double), word + original * sizeof(double), sizeof(double));
    }
    return true;
  }
  /// Replaces the plant's state and conditions in these lanes.
  void assist(std::uint32_t lanes, const plant_sim::BasicState<S>& before) noexcept {
    for (std::uint32_t left = lanes; left != 0; left &= left - 1) {
      const auto lane = static_cast<std::uint32_t>(std::countr_zero(left));
      AssistedCycle cycle{.run = runs_[lane]};
      rig::take_lane<S>(packed_.time_ns, lane, &cycle.time_ns);
      rig::take_lane<S>(packed_.period_s, lane, &cycle.duration_s);
      rig::take_lane<S>(packed_.duty, lane, &cycle.duty);
      rig::take_lane<S>(packed_.sent_Nm, lane, &cycle.brake_torque_Nm);
      double state[5];
      double conditions[sizeof(packed_.rig.now) / sizeof(S)];
      rig::take_lane<S>(before, lane, state);
      rig::take_lane<S>(packed_.rig.now, lane, conditions);
      work_.assist(work_.context, cycle, state, conditions);
      rig::put_lane<S>(packed_.rig.x, lane, state);
      rig::put_lane<S>(packed_.rig.now, lane, conditions);
    }
  }
  void store(std::uint32_t lanes) noexcept {
    for (std::uint32_t left = lanes; left != 0; left &= left - 1) {
      const auto lane = static_cast<std::uint32_t>(std::countr_zero(left));
      rig::take_lane<S>(&packed_, law_.run_words, lane, work_.runs[runs_[lane]]);
    }
    active_ &= ~lanes;
    copies_ &= ~lanes;
  }

  const LaneWork& work_;
  Course& packed_;
  const PackedLaw law_;
  std::uint32_t runs_[S::lanes]{};
  std::uint32_t heads_[levels]{};
  std::uint32_t active_{0};
  std::uint32_t copies_{0};
};

template <class S, class Law>
[[gnu::flatten]] control::BasicSlipOutput<S> answer_of(void* law, const control::BasicSlipInput<S>& input) noexcept {
  return static_cast<Law*>(law)->step(input);
}

template <class Isa, std::size_t Vectors, template <class> class Law, template <class> class Tyre,
          template <class> class Load>
void run_in_lanes(const LaneWork& work) noexcept {
  using S = rig::Pack<Isa, Vectors>;
  using Run = BrakingRun<S, Law, Tyre, Load>;
  using One = BrakingRun<double, Law, Tyre, Load>;
  static_assert(sizeof(Run) == sizeof(One) * S::lanes, "lane and run have the same words");
  static_assert(std::is_trivially_copyable_v<Run> && std::is_trivially_copyable_v<One>);
  alignas(Run) std::byte words[sizeof(Run)]{};  // the runs' words take their place
  auto& run = *std::launder(reinterpret_cast<Run*>(words));
  LaneEngine<typename Run::Course>(
      work, run, {&run.law, &answer_of<S, Law<S>>, Law<S>::estimates_theta, sizeof(One) / sizeof(double)})
      .run();
}

#ifdef ABS_HIL_LANE_ISA
// The kernels of one instruction set. A source defines ABS_HIL_LANE_ISA and ABS_HIL_LANE_VECTORS and includes this; it
// is compiled for that set alone, so it must define no function that other sources define too: tests/study/lanes checks
// the names.
#define ABS_HIL_LANE_KERNEL(law, tyre, load)                                            \
  template <>                                                                           \
  LaneKernel lane_kernel<rig::ABS_HIL_LANE_ISA, LaneKind<law, tyre, load>>() noexcept { \
    return &run_in_lanes<rig::ABS_HIL_LANE_ISA, ABS_HIL_LANE_VECTORS, law, tyre, load>; \
  }
ABS_HIL_LANE_KINDS(ABS_HIL_LANE_KERNEL)
#undef ABS_HIL_LANE_KERNEL
#endif

}  // namespace abs_hil::study::lanes
