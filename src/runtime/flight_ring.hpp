#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "abs_hil/rig/cycle_record.hpp"

namespace abs_hil::runtime {

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

}  // namespace abs_hil::runtime
