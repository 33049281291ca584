#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string_view>
#include <thread>

#include "driver/file_descriptor.hpp"

namespace abs_hil::guardian {

/// The datagram socket of systemd ($NOTIFY_SOCKET, sd_notify(3)); -1 without systemd.
[[nodiscard]] int systemd_socket() noexcept;
/// Sends a message to systemd, such as "READY=1"; nothing without it. Never waits: a message that systemd cannot take
/// at once is left out.
void tell_systemd(std::string_view message) noexcept;

/// Something that one thread signals and another one waits for: an eventfd.
class Event {
 public:
  Event();
  [[nodiscard]] int descriptor() const noexcept { return file_.get(); }
  void signal() const noexcept;
  /// True if it was signalled since the last call.
  bool take() const noexcept;

 private:
  driver::FileDescriptor file_;
};

/// Compares a clock of whole seconds, which never stands, with one of nanoseconds, which stands while the machine is
/// paused. A reading s at the time m only says that the first clock leads the second by s - m to s - m + 1 s.
/// `most_ns_` is the least of these upper limits so far. A pause is found when a lower limit is half a second above it:
/// a pause of 1.5 s at the first look after it, one of 0.6 s within a second, and each once. The limit grows by a
/// thousandth of the time, because the clocks do not run equally fast.
class ClockLead {
 public:
  /// True if the second clock has stood since the last call.
  [[nodiscard]] bool leapt(std::int64_t clock_s, std::int64_t monotonic_ns) noexcept;

 private:
  std::int64_t most_ns_{0};
  std::int64_t looked_ns_{0};
  bool first_{true};
};

/// Finds pauses of a virtual machine (QEMU's stop and cont, a migration). All other clocks of the machine stand still
/// meanwhile, so nothing else in it can know. The real-time clock goes on, and this compares it with the others: every
/// millisecond while there is a lease. It cannot use the clock's interrupts, because a pause can swallow them. Pauses
/// below about a second stay unseen.
class MachinePause {
 public:
  /// Does nothing on a computer that is not a virtual machine or has no real-time clock. Its thread has the scheduling
  /// of the thread that constructs it.
  /// @param found  called in its thread after each pause during a lease
  explicit MachinePause(std::function<void()> found);
  [[nodiscard]] bool works() const noexcept { return clock_.get() >= 0; }
  /// Readable after a pause, until `take`.
  [[nodiscard]] int descriptor() const noexcept { return happened_.descriptor(); }
  void take() const noexcept { happened_.take(); }
  /// From now on there is a lease, or none.
  void set_leased(bool leased) noexcept { leased_ = leased; }

 private:
  void watch(const std::stop_token& stop);
  /// Seconds; < 0 if the clock cannot be read.
  [[nodiscard]] std::int64_t clock_s() const;

  std::function<void()> found_;
  driver::FileDescriptor clock_{-1};
  Event happened_{};
  std::atomic<bool> leased_{false};
  ClockLead lead_{};
  std::jthread thread_{};
};

}  // namespace abs_hil::guardian
