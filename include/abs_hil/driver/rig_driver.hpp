#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abs_hil/driver/io_result.hpp"
#include "abs_hil/rig/command.hpp"
#include "abs_hil/rig/cycle_record.hpp"
#include "abs_hil/rig/measurement.hpp"

namespace abs_hil::driver {

/// Life of a driver: configure -> activate -> (read, write)* -> deactivate. From `inactive` it may be activated again.
/// A failed write makes the outputs safe and leads to `failed`, which only a new `configure` ends. A failed read leaves
/// the driver active: the caller decides whether a lost answer matters.
enum class DriverState : std::uint8_t { unconfigured, inactive, active, failed };

/// The driver calls this before it makes its outputs safe, which may take up to `make_safe_bound_ns`. Real-time safe.
class MakingSafeListener {
 public:
  virtual ~MakingSafeListener() = default;
  virtual void making_safe() noexcept = 0;
};

/// What tells a board from others, for its commissioning record. Texts, as people read them.
struct BoardIdentity {
  std::string place{};  ///< serial number, or slot if it has none: "0000:03:00.0"
  std::string logic{};  ///< version of its logic or firmware: "bitstream 2741"
};

/// One rig behind one board, real or simulated. The public functions implement the same lifecycle for every backend:
/// they write nothing while inactive, and a failed `write` makes the outputs safe before it returns. Backends implement
/// the private `do_` functions. They must call `deactivate()` in their own destructors, because the base class
/// destructor runs too late.
///
/// The real-time thread calls `read` and `write`: they never throw, allocate, lock or wait longer than the bound that
/// the backend documents. The other functions may do so; call them before and after the run.
class RigDriver {
 public:
  RigDriver() = default;
  RigDriver(RigDriver&&) = delete;  // nor copied
  virtual ~RigDriver() = default;

  /// Opens and checks the board. Writes nothing that could move the rig. Throws Unavailable.
  void configure();
  /// Takes over the outputs in the safe state and sets the counters to 0. Throws Unavailable and then stays inactive.
  /// @param now_ns monotonic time, the origin of a simulated rig's time
  void activate(std::int64_t now_ns);
  /// Latches and reads the board's inputs at `now_ns`, which must not decrease from call to call.
  IoResult read(std::int64_t now_ns, rig::Measurement& measurement) noexcept;
  /// Sends a command. While not active it sends nothing and returns `not_active`.
  /// @param sent  becomes the command as it went out: its duties are those that the outputs now have by the board's
  ///   resolution and the driver's own caps, the motor's is 0 while the motor is disabled. It is the command of an
  ///   earlier cycle if the board did not take this one and keeps that one, and the safe command after a failure.
  IoResult write(const rig::Command& command, rig::Command& sent) noexcept;
  /// The same for callers that do not ask what was sent.
  IoResult write(const rig::Command& command) noexcept {
    rig::Command sent;
    return write(command, sent);
  }
  /// A command as it would go out: rounded to the board's resolution, limited by the driver's own caps, the motor's
  /// duty 0 while the motor is disabled. The duties of `command` are in [0, 1]. Sends nothing. Real-time safe. By
  /// default any duty can be sent.
  [[nodiscard]] virtual rig::Command as_sent(const rig::Command& command) const noexcept;
  /// Brings the outputs into the safe state: drive 0, brake 0, motor disabled. Verifies it if the board can read back.
  /// May be repeated. The result is `ok` if the safe state is known to have reached the board.
  IoResult deactivate() noexcept;

  /// Tells the phase of the command that is written next. Only injected faults use it (InjectingDriver).
  virtual void note_phase(rig::Phase /*phase*/) noexcept {}
  /// Tells, whenever it changes, that the upper wheel is lifted off the lower one from now on, or lies on it again. A
  /// simulated rig then parts or joins its wheels; on a rig a person does so. Real-time safe.
  virtual void note_wheels_apart(bool /*apart*/) noexcept {}

  /// True if the last `read` showed that the board has not taken the command that was sent last; `command` becomes the
  /// one that it has. Real-time safe.
  [[nodiscard]] virtual bool took_other_command(rig::Command& /*command*/) const noexcept { return false; }
  /// The cable whose loss makes the board drop its outputs by itself, as it does whenever no command comes for a while;
  /// empty for a board without such a watchdog. The commissioning tries it.
  [[nodiscard]] virtual std::string_view watched_cable() const noexcept { return {}; }
  /// Says that no command comes for a while: a board that would drop its outputs then does so now, and `read` goes on.
  /// The first `write` after it sets them up again with duties 0. Call it with both duties 0. Not real-time safe.
  IoResult rest() noexcept { return state_ == DriverState::active ? do_rest() : IoResult{}; }

  /// Longest time that a failed `write`, or `deactivate`, waits for the board to confirm the safe state, ns. 0: it does
  /// not wait; only the board's accesses take time.
  [[nodiscard]] virtual std::int64_t make_safe_bound_ns() const noexcept { return 0; }
  /// @param listener  called in the thread that makes the outputs safe; must outlive the driver. Null: none.
  virtual void tell_before_making_safe(MakingSafeListener* listener) noexcept { listener_ = listener; }

  [[nodiscard]] DriverState state() const noexcept { return state_; }
  [[nodiscard]] virtual std::string_view name() const noexcept = 0;
  /// The simulator's true values at the last `read`, for logs only; NaN from hardware.
  [[nodiscard]] virtual rig::PlantTruth truth() const noexcept { return {}; }
  /// Facts that `configure` found about the board, one per line, for the log. Empty before `configure` and for a
  /// simulator.
  [[nodiscard]] virtual std::vector<std::string> notes() const { return {}; }
  /// Counts of the run's traffic, one per line, for the log after a run. Empty for backends that count nothing.
  [[nodiscard]] virtual std::vector<std::string> tally() const { return {}; }
  /// How long the board took to answer since `activate`; empty for a backend that waits for no answer.
  struct AnswerTimes {
    std::uint64_t answers{0};
    double mean_us{0.0};
    double longest_us{0.0};
  };
  [[nodiscard]] virtual std::optional<AnswerTimes> answer_times() const { return std::nullopt; }
  /// The last exchanges with the board, with their times, one per line, for the flight record.
  [[nodiscard]] virtual std::vector<std::string> traffic() const { return {}; }
  /// Message for the user: what the outputs do if the safe state did not reach the board.
  [[nodiscard]] virtual std::string_view what_holds_unsafe() const noexcept {
    return "its PWMs may hold their last duties";
  }
  /// The configured board. A board that differs in one of the two needs a commissioning of its own. Empty texts: the
  /// board shows nothing.
  [[nodiscard]] virtual BoardIdentity identity() const { return {}; }
  /// The duties that the active board reports for its outputs now. Another process may have set them. Sends no command.
  /// False if the board cannot tell. Not real-time safe.
  [[nodiscard]] virtual bool outputs_now(rig::Command& /*applied*/) noexcept { return false; }
  /// Writes to the configured board what changes nothing, to find out whether a write can succeed. `ok` for a board
  /// whose `configure` has shown that.
  [[nodiscard]] virtual IoResult try_write() noexcept { return {}; }
  /// All values that the configured board shows without any write, one per line, for the user.
  [[nodiscard]] virtual std::vector<std::string> inspection() { return {}; }

 private:
  virtual void do_configure() = 0;
  virtual void do_activate(std::int64_t now_ns) = 0;
  virtual IoResult do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept = 0;
  /// If it succeeds it sets `sent` as `write` documents it, to `as_sent(command)` if the board took the command.
  virtual IoResult do_write(const rig::Command& command, rig::Command& sent) noexcept = 0;
  /// Writes the safe state in any situation. Tries all outputs even if one fails.
  virtual IoResult do_make_safe() noexcept = 0;
  virtual IoResult do_rest() noexcept { return {}; }

  IoResult make_safe() noexcept;

  DriverState state_{DriverState::unconfigured};
  MakingSafeListener* listener_{nullptr};
};

}  // namespace abs_hil::driver
