#pragma once

#include <atomic>
#include <cstdint>

#include "abs_hil/driver/rig_driver.hpp"
#include "abs_hil/rig/reason.hpp"
#include "runtime/flight_ring.hpp"
#include "runtime/scheduling.hpp"

namespace abs_hil::runtime {

/// Heartbeat counters that the cycle and a guardian in another process share. They are counts, not times: when the
/// whole computer pauses, neither side mistakes the other for dead. Each counter has one writer and its own cache line.
struct HeartbeatPanel {
  alignas(64) std::atomic<std::uint64_t> cycle_beats{0};     ///< the cycle's thread adds 1 at the start of each cycle
  alignas(64) std::atomic<std::uint64_t> safe_beats{0};      ///< it adds 1 each time before it makes the outputs safe
  alignas(64) std::atomic<std::uint64_t> guardian_beats{0};  ///< the guardian adds 1 each time it looks
  /// The guardian takes the outputs back: the cycle must make them safe. The first reason stays.
  alignas(64) std::atomic<rig::Reason> taken_back_for{rig::Reason::none};
};
static_assert(std::atomic<rig::Reason>::is_always_lock_free);

/// The cycle's side of the supervision: it beats, fills the flight recorder, and checks that the guardian still beats.
/// Real-time safe.
class Heartbeat {
 public:
  /// @param silent_cycles_max  the guardian counts as lost after this number of silent cycles; 0: no guardian
  Heartbeat(HeartbeatPanel& panel, FlightRing& recorder, std::uint64_t silent_cycles_max = 0) noexcept
      : panel_(panel), recorder_(recorder), silent_cycles_max_(silent_cycles_max) {}

  /// Beats. Call it at the start of a cycle, before any read or write, so that the guardian covers that cycle's
  /// outputs.
  void beat() noexcept { panel_.cycle_beats.store(++beats_, std::memory_order_relaxed); }
  /// Checks the guardian's heartbeat; call it once per cycle. True if the guardian counts as lost.
  [[nodiscard]] bool guardian_lost() noexcept {
    if (silent_cycles_max_ == 0) return false;
    const std::uint64_t seen = panel_.guardian_beats.load(std::memory_order_relaxed);
    silent_cycles_ = seen == guardian_beats_ ? silent_cycles_ + 1 : 0;
    guardian_beats_ = seen;
    return silent_cycles_ >= silent_cycles_max_;
  }
  /// Why the guardian takes the outputs back; `none` while the cycle may drive them.
  [[nodiscard]] rig::Reason taken_back_for() const noexcept {
    return panel_.taken_back_for.load(std::memory_order_relaxed);
  }
  void keep(const rig::CycleRecord& record) noexcept { recorder_.push(record); }
  [[nodiscard]] std::uint64_t silent_cycles() const noexcept { return silent_cycles_; }

 private:
  HeartbeatPanel& panel_;
  FlightRing& recorder_;
  std::uint64_t silent_cycles_max_;
  std::uint64_t beats_{0};
  std::uint64_t guardian_beats_{0};
  std::uint64_t silent_cycles_{0};
};

/// Supervisor of a run, such as the guardian. It must be armed before the outputs are enabled, and is told when they
/// are safe again.
class RunGuard : public driver::MakingSafeListener {
 public:
  /// Arms the supervisor; the driver is configured and inactive. Throws driver::Unavailable: the run must not start
  /// then.
  /// @param controller  what the cycle's thread has; a weaker supervisor is refused, because it would act too late
  virtual void arm(const Scheduling& controller) = 0;
  /// Tells that the driver was deactivated. The thread that deactivated it makes the call. Real-time safe.
  /// @param safe  true if the board is known to be in the safe state
  virtual void outputs_released(bool safe) noexcept = 0;
};

}  // namespace abs_hil::runtime
