#pragma once

#include <sys/types.h>

#include <atomic>
#include <cstdint>
#include <optional>

#include "abs_hil/driver/safe_state_writer.hpp"
#include "guardian/mail.hpp"
#include "guardian/shared_region.hpp"
#include "guardian/watchdog.hpp"
#include "runtime/clock.hpp"

namespace abs_hil::guardian {

/// The processes of runs, as a guard sees them. A handle never refers to another process. No call waits.
class Processes {
 public:
  virtual ~Processes() = default;

  /// A handle on a process that this one may end; < 0 if there is none, or if it may not.
  [[nodiscard]] virtual int open(pid_t pid) noexcept = 0;
  virtual void close(int handle) noexcept = 0;
  /// True once the process and all its threads have ended, so that none of them can write any more.
  [[nodiscard]] virtual bool gone(int handle) noexcept = 0;
  /// Sends SIGKILL, which also ends stopped and hung processes.
  virtual void end(int handle) noexcept = 0;
};

struct GuardParts {
  runtime::Clock& clock;
  driver::SafeStateWriter& board;
  Processes& processes;
  std::int64_t timeout_ns{0};            ///< longest silence of a run; a run may ask for less
  std::int64_t keep_ns{0};               ///< from one look at the board to the next while no run is covered
  std::int64_t insist_ns{0};             ///< of the guard of one run: how long it tries; 0: it never gives up
  Mail* mail{nullptr};                   ///< of the resident guard; replaced with its talker
  ServicePage* page{nullptr};            ///< of the resident guard
  std::atomic<bool>* released{nullptr};  ///< a person has ended the tries, which counts only while they are made
};

/// The guard: what stands between a run that no longer works and outputs that stay on. It owns the board. It does
/// nothing but look at the heartbeat, look at the board and write zeros, end a process, and take orders of fixed size;
/// none of these waits, except for the board. Everything that talks is in another process (talker.hpp), which may hang
/// or die: the guard only hears less.
///
/// At each moment it has one of these duties:
///
///     keep     no run is covered: the outputs are looked at every `keep_ns` and kept at zero, from the start to the
///              end, before a run is covered, between two runs of a lease, and after it
///     watch    a run is covered: its heartbeat is looked at eight times in its timeout; the board is the run's from
///              its first cycle on, and until then it is looked at as in `keep`
///     act      a run died, fell silent, or must give the outputs back: it is ended if it may still write, then zeros
///              are written and read back, again and again until they are verified
///
/// The run's page is not believed: a run that says that its outputs are safe is watched until two looks at the board,
/// at least `keep_ns` apart, have shown it. A holder that writes to the board while it is not covered is ended.
class BoardGuard {
 public:
  explicit BoardGuard(const GuardParts& parts) noexcept : parts_(parts) {}

  /// Makes the outputs safe: the first thing that a resident guard does. Not for the guard of one run.
  void begin() noexcept;
  /// The guard of one run: covers the process behind `handle` from now on. Takes both over.
  void cover_only(Pages pages, int handle) noexcept;
  /// Looks once. Call it again at `next_ns`, or earlier when there are orders or a process has ended.
  void look() noexcept;
  [[nodiscard]] std::int64_t next_ns() const noexcept { return next_ns_; }
  /// The resident guard: ends the lease and the service once the outputs are verified, or could not be for a second.
  void end() noexcept;
  /// The talker died, and with it the holder's connection. A run that is covered goes on; its lease ends with it.
  void lost_talker() noexcept;
  [[nodiscard]] bool over() const noexcept { return over_; }
  /// True if the outputs were zero at the latest look, and nobody is left who could change them.
  [[nodiscard]] bool safe() const noexcept { return safe_; }
  /// Of the latest run.
  [[nodiscard]] const GuardianReport& report() const noexcept { return report_; }
  /// The holder's handle; -1: nobody has the lease, or the process is gone.
  [[nodiscard]] int holder() const noexcept { return gone_ ? -1 : handle_; }
  /// Readable when there are orders; another one after the mail was replaced. -1: the guard takes none.
  [[nodiscard]] int orders() const noexcept { return parts_.mail == nullptr ? -1 : parts_.mail->order_descriptor(); }
  [[nodiscard]] std::int64_t look_period_ns() const noexcept { return look_period_ns_; }
  /// Somebody without a cover drives the board: several looks have found an output on, the latest just now.
  [[nodiscard]] bool driven_by_others() const noexcept {
    constexpr std::int64_t recent_ns = 20'000'000;
    return duty_ == Duty::keep && foreign_looks_ >= foreign_looks_most && now_ns_ - foreign_seen_ns_ < recent_ns;
  }

 private:
  static constexpr int foreign_looks_most = 5;
  enum class Duty : std::uint8_t { keep, watch, act };

  void take(const Order& order) noexcept;
  void grant(const Order& order) noexcept;
  void cover(std::int64_t timeout_ns) noexcept;
  void take_back(rig::Reason reason) noexcept;
  void tell(NewsWord word, Refusal why = Refusal::none, const Pages::Descriptors& pages = {}) noexcept;

  void keep() noexcept;
  [[nodiscard]] driver::IoResult access(bool only_look) noexcept;
  void look_at_board() noexcept;
  void watch() noexcept;
  void look_before_first_cycle() noexcept;
  [[nodiscard]] bool believe_once_seen() noexcept;
  void dismiss() noexcept;
  void begin_to_act(bool writes_zeros_only) noexcept;
  void act() noexcept;
  [[nodiscard]] bool must_give_up() noexcept;
  void end_holder(Refusal why) noexcept;
  void end_lease(Refusal why = Refusal::none) noexcept;
  [[nodiscard]] bool former_gone() noexcept;
  [[nodiscard]] rig::Reason must_give_back_for(Stage stage) noexcept;

  GuardParts parts_;
  Duty duty_{Duty::keep};
  std::int64_t now_ns_{0};
  std::int64_t next_ns_{0};
  std::int64_t look_period_ns_{0};
  bool ending_{false};
  std::int64_t ends_at_ns_{0};
  bool over_{false};

  // The board while no run is covered.
  driver::IoResult board_{driver::IoError::not_active};
  bool safe_{false};
  std::int64_t next_keep_ns_{0};
  std::int64_t looked_ns_{-1};
  int looks_until_believed_{0};      ///< of a run that says that its outputs are safe
  std::int64_t blind_since_ns_{-1};  ///< since then those looks had no answer; < 0: the last had one
  int foreign_duties_{0};            ///< grows with each look that finds an output on
  int foreign_looks_{0};             ///< those looks, until none has come for a minute
  std::int64_t foreign_seen_ns_{0};  ///< the last of them

  // The lease.
  std::uint32_t lease_{0};  ///< 0: nobody has it
  std::uint32_t last_lease_{0};
  int handle_{-1};
  pid_t pid_{0};
  bool gone_{false};
  bool covered_once_{false};
  bool orphaned_{false};           ///< its holder's connection died with the talker
  std::int64_t covered_by_ns_{0};  ///< the holder must have a run covered by then
  std::optional<Pages> pages_{};
  rig::Reason taken_back_for_{rig::Reason::none};
  int former_handle_{-1};  ///< a holder that was ended and is not gone yet
  pid_t former_pid_{0};
  std::int64_t end_former_at_ns_{0};

  // The run that is covered.
  std::optional<Watchdog> watchdog_{};
  std::int64_t timeout_ns_{0};
  std::int64_t last_look_ns_{0};
  runtime::SuspensionFinder suspensions_{};
  GuardianReport report_{};
  std::int64_t acts_since_ns_{0};
  std::int64_t next_try_ns_{0};
  int confirmed_{0};            ///< looks in a row that found the outputs at zero
  std::int64_t gone_by_ns_{0};  ///< so long the first write waits for the end of the run's process
};

}  // namespace abs_hil::guardian
