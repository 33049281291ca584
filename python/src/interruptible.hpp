// A loop over C++ threads that Ctrl-C, or an exception of the user's progress function, ends at once.
#pragma once

#include <pybind11/functional.h>
#include <pybind11/pybind11.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <thread>
#include <utility>

namespace abs_hil::python {

/// Python handles signals in its main thread alone, so the thread that makes this asks for them and tells the progress,
/// after each hundredth of the work and every 50 ms. What it finds stops the pieces of work of all threads. Make it and
/// call `run` with Python's lock held.
class Interruptible {
 public:
  /// Called with (done, all).
  using Progress = std::function<void(std::uint64_t, std::uint64_t)>;
  explicit Interruptible(Progress progress) : progress_(std::move(progress)) {}

  /// Runs `loop` without Python's lock, then throws what ended it early.
  template <class Loop>
  void run(const Loop& loop) {
    try {
      const pybind11::gil_scoped_release release;
      loop();
    } catch (const Stopped&) {
    }
    if (error_) throw std::move(*error_);
    if (progress_ && told_ != all_) progress_(all_, all_);
  }

  /// To be called by any thread within `loop` after each piece of work. Throws what `run` takes for its end.
  void after(std::uint64_t done, std::uint64_t all) {
    if (stopped_) throw Stopped{};
    if (std::this_thread::get_id() != owner_) return;
    all_ = all;
    const auto now = std::chrono::steady_clock::now();
    if (done < told_ + std::max<std::uint64_t>(1, all / 100) && now - asked_ < std::chrono::milliseconds(50)) return;
    asked_ = now;
    const pybind11::gil_scoped_acquire gil;
    try {
      if (PyErr_CheckSignals() != 0) throw pybind11::error_already_set();
      told_ = done;
      if (progress_ && done > 0) progress_(done, all);
    } catch (pybind11::error_already_set& error) {
      error_.emplace(std::move(error));
      stopped_ = true;
      throw Stopped{};
    }
  }

 private:
  struct Stopped {};

  Progress progress_;
  std::thread::id owner_{std::this_thread::get_id()};
  std::chrono::steady_clock::time_point asked_{std::chrono::steady_clock::now()};
  std::atomic<bool> stopped_{false};
  std::optional<pybind11::error_already_set> error_{};
  std::uint64_t told_{0};
  std::uint64_t all_{0};
};

}  // namespace abs_hil::python
