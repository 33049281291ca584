#pragma once

#include <atomic>
#include <cstdint>

#include "abs_hil/rig/reason.hpp"
#include "runtime/cycle_watch.hpp"
#include "runtime/flight_ring.hpp"

namespace abs_hil::guardian {

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

/// The cycle's side of the supervision. Real-time safe.
class Heartbeat final : public runtime::CycleWatch {
 public:
  /// @param silent_cycles_max  the guardian counts as lost after this number of silent cycles; 0: no guardian
  Heartbeat(RunPage& ours, const GuardPage& guard, runtime::FlightRing& recorder,
            std::uint64_t silent_cycles_max = 0) noexcept
      : ours_(ours), guard_(guard), recorder_(recorder), silent_cycles_max_(silent_cycles_max) {}

  [[nodiscard]] runtime::GuardianSign beat() noexcept override {
    ours_.cycle_beats.store(++beats_, std::memory_order_relaxed);
    const rig::Reason taken_back_for = guard_.taken_back_for.load(std::memory_order_relaxed);
    if (silent_cycles_max_ == 0) return {taken_back_for, 0};
    const std::uint64_t seen = guard_.guardian_beats.load(std::memory_order_relaxed);
    silent_cycles_ = seen == guardian_beats_ ? silent_cycles_ + 1 : 0;
    guardian_beats_ = seen;
    return {silent_cycles_ >= silent_cycles_max_ ? rig::Reason::guardian_silent : taken_back_for, silent_cycles_};
  }
  void keep(const rig::CycleRecord& record) noexcept override { recorder_.push(record); }

 private:
  RunPage& ours_;
  const GuardPage& guard_;
  runtime::FlightRing& recorder_;
  std::uint64_t silent_cycles_max_;
  std::uint64_t beats_{0};
  std::uint64_t guardian_beats_{0};
  std::uint64_t silent_cycles_{0};
};

/// One look of the guardian at the controller.
struct HeartbeatReading {
  std::int64_t now_ns{0};                         ///< guardian's clock
  std::uint64_t cycle_beats{0};                   ///< heartbeats of the cycle's thread; 0: no cycle has begun yet
  Stage stage{Stage::guarded};                    ///< read after `controller_gone`
  bool controller_gone{false};                    ///< the process and all its threads have ended
  rig::Reason taken_back_for{rig::Reason::none};  ///< why the controller was asked to make the outputs safe; none: not
};

/// What the guardian has to do.
enum class Verdict : std::uint8_t {
  wait,       ///< nothing: the run is in order
  make_safe,  ///< bring the outputs into the safe state; the reason is known
  dismissed   ///< the run is over and its outputs are safe
};

/// Decides from heartbeat and stage whether the outputs must be made safe. A heartbeat is a change of the cycle count.
/// Silence is measured in the guardian's own time: each look adds at most two look periods, so a pause of the guardian,
/// or of the whole computer, does not count as silence of the controller. The first reason stays.
///
/// A controller that was asked to give the outputs back has the timeout for it. After that it counts as silent.
class Watchdog {
 public:
  /// @param timeout_ns  longest silence of the controller, > 0
  /// @param look_period_ns  time between two looks, > 0; the verdict comes at most one period after the timeout
  /// @param making_safe_ns  added to the timeout while the controller waits for its board to confirm the safe state,
  ///                        >= 0
  Watchdog(std::int64_t timeout_ns, std::int64_t look_period_ns, std::int64_t making_safe_ns = 0) noexcept
      : timeout_ns_(timeout_ns), look_period_ns_(look_period_ns), making_safe_ns_(making_safe_ns) {}

  /// A run that waits for a whole second begins its first cycle within this time, ns.
  static constexpr std::int64_t first_beat_ns = 10'000'000'000;

  [[nodiscard]] Verdict look(const HeartbeatReading& reading) noexcept;
  /// Why the safe state is needed; `none` as long as it is not. Also set if the controller died after it had released
  /// its outputs and before its files were written.
  [[nodiscard]] rig::Reason reason() const noexcept { return reason_; }
  /// Time without a heartbeat up to the last look.
  [[nodiscard]] std::int64_t silence_ns() const noexcept { return silence_ns_; }

 private:
  void measure_silence(const HeartbeatReading& reading) noexcept;
  /// Longest silence at this stage.
  [[nodiscard]] std::int64_t patience_ns(const HeartbeatReading& reading) const noexcept;

  std::int64_t timeout_ns_;
  std::int64_t look_period_ns_;
  std::int64_t making_safe_ns_;
  std::int64_t last_look_ns_{-1};  ///< < 0: not looked yet
  std::uint64_t last_beats_{0};
  std::int64_t silence_ns_{0};
  std::int64_t asked_back_ns_{0};  ///< time since the controller was asked to give the outputs back
  bool died_released_{false};
  rig::Reason reason_{rig::Reason::none};
};

}  // namespace abs_hil::guardian
