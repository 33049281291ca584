#pragma once

#include <string_view>

namespace abs_hil::runtime {

/// A program must end by its own decision. Code of a controller in this process that calls exit(), quick_exit() or, in
/// the cycle's thread, _exit() or exec(), would otherwise end a run in mid-braking with a status of its own choice.

/// The outputs of a run, for the moment in which the program is about to end.
class Outputs {
 public:
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

/// Says why on stderr and ends the program with status 1.
/// @param make_safe  makes the outputs of the run safe first
[[noreturn]] void end_early(std::string_view why, bool make_safe) noexcept;

}  // namespace abs_hil::runtime
