#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "guardian/board_guard.hpp"

namespace abs_hil::guardian::test {

inline constexpr std::int64_t us = 1'000;
inline constexpr std::int64_t ms = 1'000'000;

/// Virtual time that advances only by waiting, with events at given times.
class ScriptedClock final : public runtime::Clock {
 public:
  [[nodiscard]] std::int64_t now_ns() noexcept override { return now_; }
  void sleep_until(std::int64_t time_ns) noexcept override {
    while (now_ < time_ns) {
      now_ = std::min(time_ns, now_ + 100 * us);
      if (happens) happens(now_);
    }
  }
  /// The computer pauses: no event happens meanwhile.
  void jump(std::int64_t duration_ns) { now_ += duration_ns; }
  /// The computer is suspended: the monotonic clock stands still.
  void suspend(std::int64_t duration_ns) { suspended_ns_ += duration_ns; }
  [[nodiscard]] std::int64_t suspended_ns() noexcept override { return suspended_ns_; }

  std::function<void(std::int64_t)> happens;

 private:
  std::int64_t now_{1'000 * ms};
  std::int64_t suspended_ns_{0};
};

/// Log of all actions in order, as text.
using Story = std::vector<std::string>;

/// Processes that die when the script says so, or some time after they were ended. A handle is the process' number less
/// `first`.
class ScriptedProcesses final : public Processes {
 public:
  ScriptedProcesses(ScriptedClock& clock, Story& story) : clock_(clock), story_(story) {}

  [[nodiscard]] int open(pid_t pid) noexcept override {
    if (!lives(pid - first)) return -1;
    ++handles;
    return pid - first;
  }
  void close(int handle) noexcept override {
    must_be_one(handle);
    --handles;
  }
  [[nodiscard]] bool gone(int handle) noexcept override {
    must_be_one(handle);
    const bool is_gone = !lives(handle);
    if (is_gone && !std::exchange(told_[handle], true)) story_.emplace_back("gone");
    return is_gone;
  }
  void end(int handle) noexcept override {
    must_be_one(handle);
    if (!ended_[handle]) story_.emplace_back("end");
    ended_[handle] = true;
    std::int64_t& at_ns = dies_at_ns.try_emplace(handle, INT64_MAX).first->second;
    at_ns = std::min(at_ns, clock_.now_ns() + dying_takes_ns);
  }
  [[nodiscard]] bool lives(int handle) const {
    const auto found = dies_at_ns.find(handle);
    return found == dies_at_ns.end() || clock_.now_ns() < found->second;
  }

  std::map<int, std::int64_t> dies_at_ns{};
  std::int64_t dying_takes_ns{200 * us};
  pid_t first{0};
  int handles{0};  ///< that are open

 private:
  static void must_be_one(int handle) noexcept {
    if (handle < 0) std::abort();
  }

  ScriptedClock& clock_;
  Story& story_;
  std::map<int, bool> told_{};
  std::map<int, bool> ended_{};
};

/// A board that holds what was last written to it.
class ScriptedBoard final : public driver::SafeStateWriter {
 public:
  explicit ScriptedBoard(Story& story) : story_(story) {}
  [[nodiscard]] std::string_view name() const noexcept override { return "scripted"; }
  void prepare() override {
    ++prepared;
    if (absent) throw driver::Unavailable("not there");
  }
  [[nodiscard]] driver::IoResult make_safe() noexcept override {
    story_.emplace_back("write");
    held = true;
    if (fails_first-- > 0) return {driver::IoError::no_answer, 0x6C};
    duty = 0.0;
    return {};
  }
  [[nodiscard]] driver::IoResult verify_safe() noexcept override {
    story_.emplace_back("look");
    held = true;
    if (fails_first > 0) return make_safe();
    if (duty == 0.0) return {};
    duty = 0.0;
    return {driver::IoError::foreign_writer, 0x6C};
  }
  [[nodiscard]] bool works_beside_owner() const noexcept override { return shared; }
  [[nodiscard]] bool tells_duties() const noexcept override { return shared; }
  [[nodiscard]] std::int64_t owner_needs_ns() const noexcept override { return 300 * ms; }
  void let_go() noexcept override { held = refuses_owners = false; }
  void take_hold() noexcept override { refuses_owners = true; }

  double duty{0.0};
  bool held{true};  ///< its handle is open
  bool refuses_owners{true};
  bool shared{true};
  int fails_first{0};
  int prepared{0};  ///< how often it was to be opened
  bool absent{false};

 private:
  Story& story_;
};

/// The resident service's guard over scripted parts: it waits 20 ms for a run, and looks every 5 ms.
inline GuardParts resident_guard(ScriptedClock& clock, ScriptedBoard& board, ScriptedProcesses& processes, Mail& mail,
                                 ServicePage& page) {
  return {.clock = clock,
          .board = board,
          .processes = processes,
          .timeout_ns = 20 * ms,
          .keep_ns = 5 * ms,
          .mail = &mail,
          .page = &page};
}

}  // namespace abs_hil::guardian::test
