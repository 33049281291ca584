#pragma once

#include <ucontext.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <stdexcept>
#include <vector>

namespace abs_hil::runtime::test {

/// A stateless model checker for two threads. It repeats the same code with every schedule and every result of loads. A
/// load may return any value that C++'s memory model allows for a variable with a single writer: none older than what
/// the thread has seen or what happened before. Vector clocks check plain slots for data races (Lamport; FastTrack,
/// Flanagan and Freund 2009).
class Explorer {
 public:
  static constexpr std::size_t threads = 2;
  using VectorClock = std::array<std::uint64_t, threads>;
  enum class Weakened { nothing, release_to_relaxed, acquire_to_relaxed };

  explicit Explorer(Weakened weakened = Weakened::nothing) : weakened_(weakened) {}

  /// Plays `make` and its two threads in every way. `make` returns the threads' bodies and a final check.
  struct Play {
    std::array<std::function<void()>, threads> bodies;
    std::function<bool()> sound;  ///< run after both, seeing all they did
  };
  struct Verdict {
    std::uint64_t executions{0};
    std::uint64_t races{0};
    std::uint64_t unsound{0};
  };
  Verdict explore(const std::function<Play()>& make);

  static Explorer& current() { return *current_; }

  // For the model's variables.
  void yield() {
    if (running_ < threads) swapcontext(&contexts_[running_], &scheduler_);
  }
  /// Chooses one of `count` alternatives.
  std::size_t choose(std::size_t count);
  [[nodiscard]] std::size_t thread() const { return running_; }
  [[nodiscard]] VectorClock& clock() { return running_ < threads ? clocks_[running_] : all_; }
  void race() { raced_ = true; }
  [[nodiscard]] Weakened weakened() const { return weakened_; }

 private:
  struct Choice {
    std::size_t taken;
    std::size_t count;
  };
  void run_once(const Play& play);
  bool next_choices();
  static void enter();

  static inline Explorer* current_ = nullptr;
  Weakened weakened_;
  std::vector<Choice> choices_{};
  std::size_t at_{0};
  std::size_t running_{threads};  ///< `threads`: the checker itself, before and after
  std::array<ucontext_t, threads> contexts_{};
  ucontext_t scheduler_{};
  std::array<std::vector<char>, threads> stacks_{};
  std::array<bool, threads> finished_{};
  const Play* play_{nullptr};
  std::array<VectorClock, threads> clocks_{};
  VectorClock all_{};
  bool raced_{false};
};

/// What a ring works on in the model.
struct ModelledMemory {
  template <typename T>
  class Atomic {
   public:
    explicit Atomic(T value) { stores_.push_back({value, Explorer::threads, 0, {}}); }
    [[nodiscard]] T load(std::memory_order order) const;
    void store(T value, std::memory_order order);

   private:
    struct Store {
      T value;
      std::size_t writer;
      std::uint64_t when;               ///< the writer's own time
      Explorer::VectorClock published;  ///< what the writer knew, if released
    };
    mutable std::array<std::size_t, Explorer::threads> seen_{};
    std::vector<Store> stores_{};
  };

  template <typename T>
  class Slot {
   public:
    Slot& operator=(const T& value) {
      touch(true);
      value_ = value;
      return *this;
    }
    operator T() const {  // NOLINT: reads as a plain variable does
      touch(false);
      return value_;
    }

   private:
    void touch(bool write) const;
    T value_{};
    mutable Explorer::VectorClock written_{}, read_{};
  };
};

template <typename T>
T ModelledMemory::Atomic<T>::load(std::memory_order order) const {
  Explorer& e = Explorer::current();
  const std::size_t me = e.thread();
  if (me == Explorer::threads || stores_.back().writer == me) return stores_.back().value;  // its own last word
  e.yield();
  // Nothing older than what this thread has seen, or knows to have happened before.
  std::size_t oldest = seen_[me];
  for (std::size_t i = oldest; i < stores_.size(); ++i) {
    const Store& store = stores_[i];
    if (store.writer == Explorer::threads || store.when <= e.clock()[store.writer]) oldest = i;
  }
  const std::size_t taken = stores_.size() - 1 - e.choose(stores_.size() - oldest);
  seen_[me] = taken;
  const bool acquires = order == std::memory_order_acquire && e.weakened() != Explorer::Weakened::acquire_to_relaxed;
  if (acquires) {
    for (std::size_t t = 0; t < Explorer::threads; ++t) {
      e.clock()[t] = std::max(e.clock()[t], stores_[taken].published[t]);
    }
  }
  return stores_[taken].value;
}

template <typename T>
void ModelledMemory::Atomic<T>::store(T value, std::memory_order order) {
  Explorer& e = Explorer::current();
  const std::size_t me = e.thread();
  if (me < Explorer::threads) {
    e.yield();
    ++e.clock()[me];
    seen_[me] = stores_.size();
  }
  const bool releases = order == std::memory_order_release && e.weakened() != Explorer::Weakened::release_to_relaxed;
  stores_.push_back(
      {value, me, me < Explorer::threads ? e.clock()[me] : 0, releases ? e.clock() : Explorer::VectorClock{}});
}

template <typename T>
void ModelledMemory::Slot<T>::touch(bool write) const {
  Explorer& e = Explorer::current();
  const std::size_t me = e.thread();
  if (me == Explorer::threads) return;
  ++e.clock()[me];
  for (std::size_t t = 0; t < Explorer::threads; ++t) {
    if (t == me) continue;
    if (written_[t] > e.clock()[t] || (write && read_[t] > e.clock()[t])) e.race();
  }
  (write ? written_ : read_)[me] = e.clock()[me];
}

}  // namespace abs_hil::runtime::test
