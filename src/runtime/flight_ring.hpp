#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "abs_hil/rig/cycle_record.hpp"

namespace abs_hil::runtime {

/// One record of a flight recorder, in words, so that a reader may look at it at any time, even at one that a killed
/// writer left half done: `version` is odd while it is written, and 2 (n + 1) once push number n is whole.
struct FlightSlot {
  static constexpr std::size_t words = sizeof(rig::CycleRecord) / sizeof(std::uint64_t);
  static_assert(words * sizeof(std::uint64_t) == sizeof(rig::CycleRecord));

  std::atomic<std::uint64_t> version{0};
  std::array<std::atomic<std::uint64_t>, words> record{};
};
static_assert(std::atomic<std::uint64_t>::is_always_lock_free, "slots are shared between processes");

/// The last records of a run, the oldest overwritten by the newest: what is left to look at after a fault or a crash.
/// One writer, the cycle's thread; any number of readers in any process, none of which the writer ever waits for. A
/// sequence lock in each slot: Boehm, "Can seqlocks get along with programming language memory models?", 2012.
class FlightRing {
 public:
  /// Slots needed for so much time, at least 1.
  [[nodiscard]] static std::size_t slots_for(double duration_s, double rate_Hz) noexcept;
  /// @param slots zeroed, at least one; must outlive the ring
  explicit FlightRing(std::span<FlightSlot> slots) noexcept : slots_(slots) {}

  /// Writer. Real-time safe.
  void push(const rig::CycleRecord& record) noexcept;
  /// Reader: what is whole, oldest first. Allocates.
  [[nodiscard]] std::vector<rig::CycleRecord> contents() const;

 private:
  std::span<FlightSlot> slots_;
  std::size_t next_{0};  ///< the writer's own
  std::uint64_t pushed_{0};
};

}  // namespace abs_hil::runtime
