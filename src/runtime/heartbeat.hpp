#pragma once

#include <atomic>
#include <cstdint>

#include "abs_hil/driver/rig_driver.hpp"
#include "runtime/flight_ring.hpp"

namespace abs_hil::runtime {

/// Signs of life between the cycle and a guardian in another process. Counts, not times: a computer that stood still
/// as a whole makes nobody look dead. Each word has one writer and a cache line of its own.
struct HeartbeatPanel {
  alignas(64) std::atomic<std::uint64_t> cycle_beats{0};  ///< the cycle's thread: one at the start of each cycle
  alignas(64) std::atomic<std::uint64_t> safe_beats{0};   ///< the cycle's thread: one before it makes the outputs safe
  alignas(64) std::atomic<std::uint64_t> guardian_beats{0};  ///< the guardian: one each time it looks
};

/// What the cycle does for those who watch over it: its own sign of life, the flight recorder, and a look at whether
/// the guardian still gives signs of life. Real-time safe.
class Heartbeat {
 public:
  /// @param silent_cycles_max  cycles without a sign of life after which the guardian counts as lost; 0: there is none
  Heartbeat(HeartbeatPanel& panel, FlightRing& recorder, std::uint64_t silent_cycles_max = 0) noexcept
      : panel_(panel), recorder_(recorder), silent_cycles_max_(silent_cycles_max) {}

  /// At the start of a cycle, before anything is read or written: what this cycle writes is already watched over.
  void beat() noexcept { panel_.cycle_beats.store(++beats_, std::memory_order_relaxed); }
  /// Once a cycle. True from the cycle on in which the guardian counts as lost.
  [[nodiscard]] bool guardian_lost() noexcept {
    if (silent_cycles_max_ == 0) return false;
    const std::uint64_t seen = panel_.guardian_beats.load(std::memory_order_relaxed);
    silent_cycles_ = seen == guardian_beats_ ? silent_cycles_ + 1 : 0;
    guardian_beats_ = seen;
    return silent_cycles_ >= silent_cycles_max_;
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

/// Whoever must stand by before outputs may be enabled, and be told when they are safe again.
class RunGuard : public driver::MakingSafeListener {
 public:
  /// The driver is configured and inactive. Throws driver::Unavailable: then the run does not start.
  virtual void stand_guard() = 0;
  /// The driver was deactivated; called by the thread that did so. Real-time safe.
  /// @param safe  the safe state is known to have reached the board
  virtual void outputs_released(bool safe) noexcept = 0;
};

}  // namespace abs_hil::runtime
