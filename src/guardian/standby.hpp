#pragma once

#include <cstdint>

#include "abs_hil/driver/safe_state_writer.hpp"
#include "guardian/board_guard.hpp"
#include "guardian/mail.hpp"
#include "runtime/clock.hpp"

namespace abs_hil::guardian {

/// The second small guard, in a process of its own. It watches the resident guard, and acts once if that one dies or
/// stands still: the case in which a run and its guard are killed or stopped together. In order, it
///
///     1. ends a guard that stands still: stopped between two accesses it could undo zeros later;
///     2. gives a run that is covered its own time to notice that the guard is silent, and to end in order;
///     3. ends the run if the outputs are not zero then, or if it still lives a second later;
///     4. writes zeros and reads them back until they are verified and the run is gone.
///
/// Then its work is done: the service manager starts the service again. While the guard lives it writes nothing to the
/// board, and opens it only while nobody has the lease: a driver takes its questions for another program's.
class Standby {
 public:
  struct Parts {
    runtime::Clock& clock;
    driver::SafeStateWriter& board;
    Processes& processes;
    const ServicePage& page;
    int guard{-1};               ///< handle of the guard's process
    std::int64_t silence_ns{0};  ///< longest silence of the guard
  };
  explicit Standby(const Parts& parts) noexcept : parts_(parts), last_look_ns_(parts.clock.now_ns()) {}

  /// Looks once. Call it again at `next_ns`.
  void look() noexcept;
  [[nodiscard]] std::int64_t next_ns() const noexcept { return next_ns_; }
  [[nodiscard]] bool over() const noexcept { return over_; }
  /// True once it has written and verified zeros.
  [[nodiscard]] bool acted() const noexcept { return acted_; }

 private:
  [[nodiscard]] bool guard_lost() noexcept;
  void act() noexcept;
  void prepare() noexcept;

  Parts parts_;
  std::int64_t now_ns_{0};
  std::int64_t next_ns_{0};
  std::int64_t last_look_ns_;
  std::int64_t silent_ns_{0};
  std::uint64_t beats_{0};
  bool prepared_{false};  ///< it has tried to open the board
  bool acting_{false};
  bool zeroed_{false};
  bool acted_{false};
  bool over_{false};
  int run_{-1};  ///< handle of the holder
  pid_t run_pid_{0};
  std::int64_t run_may_drive_until_ns_{0};
  std::int64_t run_may_live_until_ns_{0};
};

}  // namespace abs_hil::guardian
