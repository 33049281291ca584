#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "guardian/guardian_loop.hpp"

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

class ScriptedController final : public ControllerProcess {
 public:
  ScriptedController(ScriptedClock& clock, Story& story) : clock_(clock), story_(story) {}

  [[nodiscard]] bool gone_by(std::int64_t time_ns) noexcept override {
    while (!gone() && clock_.now_ns() < time_ns) {
      clock_.sleep_until(std::min(time_ns, clock_.now_ns() + 100 * us));
    }
    if (gone() && !told_) {
      told_ = true;
      story_.emplace_back("gone");
    }
    return gone();
  }
  void end() noexcept override {
    story_.emplace_back("end");
    dies_at_ns = std::min(dies_at_ns, clock_.now_ns() + dying_takes_ns);
  }
  [[nodiscard]] bool gone() { return clock_.now_ns() >= dies_at_ns; }

  [[nodiscard]] rig::Reason must_give_back_for() noexcept override {
    return clock_.now_ns() >= give_back_at_ns ? give_back_for : rig::Reason::none;
  }

  rig::Reason give_back_for{rig::Reason::computer_will_suspend};
  std::int64_t give_back_at_ns{INT64_MAX};
  std::int64_t dies_at_ns{INT64_MAX};
  std::int64_t dying_takes_ns{200 * us};

 private:
  ScriptedClock& clock_;
  Story& story_;
  bool told_{false};
};

class ScriptedWriter final : public driver::SafeStateWriter {
 public:
  explicit ScriptedWriter(Story& story) : story_(story) {}
  [[nodiscard]] std::string_view name() const noexcept override { return "scripted"; }
  void prepare() override {}
  [[nodiscard]] driver::IoResult make_safe() noexcept override {
    story_.emplace_back("write");
    if (fails_first-- > 0) return {driver::IoError::no_answer, 0x6C};
    return {};
  }
  [[nodiscard]] std::int64_t owner_needs_ns() const noexcept override { return 300 * ms; }
  int fails_first{0};

 private:
  Story& story_;
};

}  // namespace abs_hil::guardian::test
