#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <thread>

#include "driver/file_descriptor.hpp"
#include "guardian/talker.hpp"

namespace abs_hil::guardian {

/// Messages to systemd over its datagram socket ($NOTIFY_SOCKET, sd_notify(3)); nothing happens without it. No call
/// waits: a message that systemd cannot take at once is left out.
class ServiceManager {
 public:
  static void ready() noexcept;
  static void alive() noexcept;
  /// Of the socket; -1 without systemd.
  [[nodiscard]] static int descriptor() noexcept;
  /// One line for `systemctl status`. Sends it only if it has changed.
  void status(const std::string& text);

 private:
  std::string told_{};
};

/// Holds logind's sleep inhibitor (mode "delay"): before the computer is suspended, the service takes the outputs back
/// and makes them safe, and only then the inhibitor is let go. After the suspension the service looks at the board
/// first. Works in a thread of its own; without logind it says so once and does nothing.
class SleepWatch {
 public:
  /// @param tell  called in the watch's thread
  explicit SleepWatch(std::function<void(const std::string&)> tell);
  SleepWatch(const SleepWatch&) = delete;
  SleepWatch& operator=(const SleepWatch&) = delete;
  ~SleepWatch();

  [[nodiscard]] Interruption interruption();

 private:
  class Logind;
  void watch(const std::stop_token& stop);

  std::function<void(const std::string&)> tell_;
  driver::FileDescriptor happened_;    ///< eventfd: the computer will sleep, or has woken
  driver::FileDescriptor dealt_with_;  ///< eventfd: the outputs are safe, or cannot be made safe
  std::atomic<bool> going_to_sleep_{false};
  std::jthread thread_{};
};

}  // namespace abs_hil::guardian
