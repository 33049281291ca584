#pragma once

#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

namespace abs_hil::runtime {

/// Memory operations of a ring. Tests replace them by a model that tries every interleaving and every value that a load
/// may return.
struct NativeMemory {
  template <typename T>
  using Atomic = std::atomic<T>;
  template <typename T>
  using Slot = T;
};

/// Bounded queue from one producer thread to one consumer thread. A full ring drops the new element and counts it, so
/// that the producer (the real-time thread) never waits. `push` is real-time safe: no lock, allocation or system call.
template <typename T, typename Memory = NativeMemory>
class SpscRing {
  static_assert(std::is_trivially_copyable_v<T>, "the ring copies elements bytewise");

 public:
  /// The ring has room for `capacity` elements, rounded up to a power of two.
  explicit SpscRing(std::size_t capacity) : slots_(std::bit_ceil(capacity < 2 ? std::size_t{2} : capacity)) {}

  /// Producer. Returns false and counts a drop if the ring is full.
  bool push(const T& element) noexcept {
    const std::uint64_t tail = tail_.load(std::memory_order_relaxed);
    if (tail - known_head_ == slots_.size()) {
      known_head_ = head_.load(std::memory_order_acquire);
      if (tail - known_head_ == slots_.size()) {
        drops_.store(drops_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
        return false;
      }
    }
    slots_[index_of(tail)] = element;
    tail_.store(tail + 1, std::memory_order_release);
    return true;
  }

  /// Consumer. Returns false if the ring is empty.
  bool pop(T& element) noexcept {
    const std::uint64_t head = head_.load(std::memory_order_relaxed);
    if (head == tail_.load(std::memory_order_acquire)) return false;
    element = slots_[index_of(head)];
    head_.store(head + 1, std::memory_order_release);
    return true;
  }

  /// Number of dropped elements; any thread may call it.
  [[nodiscard]] std::uint64_t drops() const noexcept { return drops_.load(std::memory_order_relaxed); }
  [[nodiscard]] std::size_t capacity() const noexcept { return slots_.size(); }

 private:
  [[nodiscard]] std::size_t index_of(std::uint64_t position) const noexcept {
    return static_cast<std::size_t>(position) & (slots_.size() - 1);
  }

  using Counter = typename Memory::template Atomic<std::uint64_t>;

  static constexpr std::size_t cache_line = 64;
  std::vector<typename Memory::template Slot<T>> slots_;
  // Producer and consumer write to separate cache lines, so that neither slows down the other.
  alignas(cache_line) Counter tail_{0};
  std::uint64_t known_head_{0};  ///< producer's last look at head_
  Counter drops_{0};
  alignas(cache_line) Counter head_{0};
};

}  // namespace abs_hil::runtime
