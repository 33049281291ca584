#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <thread>

namespace abs_hil::runtime {

/// A program must end by its own decision. Code of a controller in this process that calls exit(), quick_exit() or, in
/// the cycle's thread, _exit() or exec(), would otherwise end a run in mid-braking with a status of its own choice.

/// The outputs of a run, for the moment in which the program is about to end.
class Outputs {
 public:
  Outputs() = default;
  Outputs(const Outputs&) = delete;
  Outputs& operator=(const Outputs&) = delete;
  virtual ~Outputs() = default;
  /// In the cycle's thread: makes the outputs safe. True if that is verified.
  virtual bool make_safe_now() noexcept = 0;
  /// In another thread: asks the cycle to do it, and waits for it for a second at most.
  virtual bool have_made_safe() noexcept = 0;
};

/// While it lives, exit() and quick_exit() make the outputs of the run safe first, say so on stderr, and end the
/// program with status 1. For `main`; one at a time.
class EarlyEndWatch {
 public:
  EarlyEndWatch();
  EarlyEndWatch(const EarlyEndWatch&) = delete;
  EarlyEndWatch& operator=(const EarlyEndWatch&) = delete;
  ~EarlyEndWatch();
};

/// Lives in the thread that runs the cycle, as long as it runs. Does nothing in a program without an EarlyEndWatch.
class CycleInThisThread {
 public:
  /// @param own_thread  true: the thread ends after the cycle, and starts no program. From now on _exit() and exec() in
  ///   it are caught as well, by a filter of system calls, if the kernel can do that.
  CycleInThisThread(Outputs& outputs, bool own_thread) noexcept;
  CycleInThisThread(const CycleInThisThread&) = delete;
  CycleInThisThread& operator=(const CycleInThisThread&) = delete;
  ~CycleInThisThread();

 private:
  Outputs* before_;
};

/// Ends the program with status 1 if one cycle takes 5 s, or in virtual time if all cycles together take 20 s and a
/// hundred times the time that they simulate: a controller in this process does not return, or is too slow. It counts
/// its own waking moments of 0.1 s, so that a stopped program or a debugger is no slow cycle.
class SlowCycleWatch {
 public:
  /// @param period_ns  of virtual time; 0: real time, which limits no whole
  explicit SlowCycleWatch(std::int64_t period_ns)
      : period_s_(static_cast<double>(period_ns) * 1e-9), thread_([this] { watch(); }) {}
  ~SlowCycleWatch() {
    {
      const std::lock_guard lock(mutex_);
      ending_ = true;
    }
    end_.notify_one();
    thread_.join();
  }
  /// Real-time safe.
  void cycle_begins() noexcept { inside_.store(true, std::memory_order_relaxed); }
  void cycle_ended() noexcept {
    cycles_.store(cycles_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
    inside_.store(false, std::memory_order_relaxed);
  }

 private:
  void watch();

  double period_s_;
  std::atomic<std::uint64_t> cycles_{0};
  std::atomic<bool> inside_{false};
  std::mutex mutex_{};
  std::condition_variable end_{};
  bool ending_{false};
  std::thread thread_;
};

}  // namespace abs_hil::runtime
