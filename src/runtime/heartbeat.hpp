#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "abs_hil/driver/rig_driver.hpp"
#include "abs_hil/rig/cycle_record.hpp"
#include "abs_hil/rig/reason.hpp"

namespace abs_hil::runtime {

/// What a thread has of the real-time set-up, as the kernel tells it.
struct Scheduling {
  int fifo_priority{0};       ///< SCHED_FIFO priority; 0: another policy
  bool memory_locked{false};  ///< some memory of its process is locked
  /// True if a thread that needs `other` can be supervised from here: neither weaker in the scheduler nor in memory.
  [[nodiscard]] constexpr bool at_least(const Scheduling& other) const noexcept {
    return fifo_priority >= other.fifo_priority && (memory_locked || !other.memory_locked);
  }
};

/// What a cycle learns from its guardian when it beats.
struct GuardianSign {
  /// Why the run must end: `guardian_silent`, or what the guardian takes the outputs back for; `none`: it may drive
  /// them.
  rig::Reason reason{rig::Reason::none};
  std::uint64_t silent_cycles{0};  ///< cycles since the guardian's last sign of life
};

/// State of the run's outputs, as the run tells its guard. The guard believes `released` and `closed` only after it has
/// read the board back, and takes any other number for `guarded`.
enum class Stage : std::uint32_t {
  guarded = 0,      ///< the run may drive the outputs
  released = 1,     ///< the run has brought the outputs into the safe state and verified it
  handed_over = 2,  ///< the run could not verify the safe state and leaves it to the guard: it writes zeros only
  closed = 3,       ///< the run is over, its files are written and its driver is gone; never after handed_over
  making_safe = 4,  ///< the run waits for the board to confirm the safe state, which may take seconds
  resting = 5,      ///< as closed, but the driver stays active and sends zeros: `commission` between two pulses
};

/// Memory that the run writes and its guard reads. The counters are counts, not times: when the whole computer pauses,
/// neither side mistakes the other for dead. Each has one writer and its own cache line.
struct RunPage {
  alignas(64) std::atomic<std::uint64_t> cycle_beats{0};  ///< the cycle's thread adds 1 at the start of each cycle
  alignas(64) std::atomic<std::uint64_t> safe_beats{0};   ///< it adds 1 each time before it makes the outputs safe
  alignas(64) std::atomic<Stage> stage{Stage::guarded};
};

/// Memory that the guard writes and the run reads. The resident guard's cannot be written by anybody else.
struct GuardPage {
  alignas(64) std::atomic<std::uint64_t> guardian_beats{0};  ///< the guard adds 1 each time it looks
  /// The guard takes the outputs back: the cycle must make them safe. The first reason stays.
  alignas(64) std::atomic<rig::Reason> taken_back_for{rig::Reason::none};
  alignas(64) std::atomic<std::uint32_t> covers{0};  ///< how often the guard has taken up its watch
  std::atomic<std::uint32_t> ends{0};                ///< how often that watch has ended
  std::atomic<bool> ended_safe{false};               ///< the last time with outputs read back as zero
};
static_assert(std::atomic<rig::Reason>::is_always_lock_free && std::atomic<Stage>::is_always_lock_free &&
              std::atomic<std::uint64_t>::is_always_lock_free && std::atomic<bool>::is_always_lock_free);

/// One record of a flight recorder, stored as atomic words. A reader may look at any time, also after the writer was
/// killed in the middle of a record. `version` is odd during a write, and 2 (n + 1) after push number n.
struct FlightSlot {
  static constexpr std::size_t words = sizeof(rig::CycleRecord) / sizeof(std::uint64_t);
  static_assert(words * sizeof(std::uint64_t) == sizeof(rig::CycleRecord));

  std::atomic<std::uint64_t> version{0};
  std::array<std::atomic<std::uint64_t>, words> record{};
};
static_assert(std::atomic<std::uint64_t>::is_always_lock_free, "slots are shared between processes");

/// Flight recorder: ring of a run's last records, for analysis after a fault or a crash. The newest record overwrites
/// the oldest. It has one writer, the cycle's thread, and any number of readers in any process; the writer never waits
/// for them. Each slot has a sequence lock: Boehm, "Can seqlocks get along with programming language memory models?",
/// 2012.
class FlightRing {
 public:
  /// Number of slots needed for a duration, at least 1.
  [[nodiscard]] static std::size_t slots_for(double duration_s, double rate_Hz) noexcept;
  /// @param slots zeroed, at least one; must outlive the ring
  explicit FlightRing(std::span<FlightSlot> slots) noexcept : slots_(slots) {}

  /// Writer. Real-time safe.
  void push(const rig::CycleRecord& record) noexcept;
  /// Reader: all complete records, oldest first. Allocates.
  [[nodiscard]] std::vector<rig::CycleRecord> contents() const;

 private:
  std::span<FlightSlot> slots_;
  std::size_t next_{0};  ///< only the writer uses it
  std::uint64_t pushed_{0};
};

/// The cycle's side of the supervision: the guardian's heartbeat and the flight recorder. Real-time safe.
class Heartbeat {
 public:
  /// @param silent_cycles_max  the guardian counts as lost after this number of silent cycles; 0: no guardian
  Heartbeat(RunPage& ours, const GuardPage& guard, FlightRing& recorder, std::uint64_t silent_cycles_max = 0) noexcept
      : ours_(ours), guard_(guard), recorder_(recorder), silent_cycles_max_(silent_cycles_max) {}

  /// Beats and looks at the guardian. Call it once, at the start of a cycle, before any read or write, so that the
  /// guardian covers that cycle's outputs.
  [[nodiscard]] GuardianSign beat() noexcept {
    ours_.cycle_beats.store(++beats_, std::memory_order_relaxed);
    const rig::Reason taken_back_for = guard_.taken_back_for.load(std::memory_order_relaxed);
    if (silent_cycles_max_ == 0) return {taken_back_for, 0};
    const std::uint64_t seen = guard_.guardian_beats.load(std::memory_order_relaxed);
    silent_cycles_ = seen == guardian_beats_ ? silent_cycles_ + 1 : 0;
    guardian_beats_ = seen;
    return {silent_cycles_ >= silent_cycles_max_ ? rig::Reason::guardian_silent : taken_back_for, silent_cycles_};
  }
  void keep(const rig::CycleRecord& record) noexcept { recorder_.push(record); }

 private:
  RunPage& ours_;
  const GuardPage& guard_;
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
