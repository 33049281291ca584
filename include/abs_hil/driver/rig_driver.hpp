#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "abs_hil/driver/io_result.hpp"
#include "abs_hil/rig/command.hpp"
#include "abs_hil/rig/cycle_record.hpp"
#include "abs_hil/rig/measurement.hpp"

namespace abs_hil::driver {

/// Life of a driver: configure -> activate -> (read, write)* -> deactivate; activate again goes on from `inactive`.
/// `failed` latches: after a failed write the outputs are made safe and only a new `configure` leads out of it. A
/// failed read leaves the driver active: whether one lost answer matters is for the caller to say.
enum class DriverState : std::uint8_t { unconfigured, inactive, active, failed };

/// Told before a driver begins to make its outputs safe, which may take up to `make_safe_bound_ns`. Real-time safe.
class MakingSafeListener {
 public:
  MakingSafeListener() = default;
  MakingSafeListener(const MakingSafeListener&) = delete;
  MakingSafeListener& operator=(const MakingSafeListener&) = delete;
  virtual ~MakingSafeListener() = default;
  virtual void making_safe() noexcept = 0;
};

/// One rig behind one board, real or simulated. The public functions keep the lifecycle for every backend alike:
/// nothing is written while inactive, and an error in `write` makes the outputs safe before it returns. Backends
/// implement the private `do_` functions and call `deactivate()` in their own destructors (a base class destructor
/// comes too late).
///
/// `read` and `write` are called from the real-time thread: they never throw, allocate, lock or wait beyond the bound
/// the backend documents. The other functions may do all that and are called before and after the run.
class RigDriver {
 public:
  RigDriver() = default;
  RigDriver(const RigDriver&) = delete;
  RigDriver& operator=(const RigDriver&) = delete;
  virtual ~RigDriver() = default;

  /// Opens and checks the board; writes nothing that could move anything. Throws Unavailable.
  void configure();
  /// Takes the outputs over in the safe state and starts the counters at 0. Throws Unavailable; then nothing is active.
  /// @param now_ns monotonic time, the origin of a simulated rig's time
  void activate(std::int64_t now_ns);
  /// Latches and reads the board's inputs as of `now_ns`, which never decreases from call to call.
  IoResult read(std::int64_t now_ns, rig::Measurement& measurement) noexcept;
  /// Sends a command. Refused with `not_active`, nothing sent, unless active.
  IoResult write(const rig::Command& command) noexcept;
  /// Leaves the outputs in the safe state: drive 0, brake 0, motor disabled, verified where the board reads back.
  /// Harmless when repeated. The result tells whether the safe state is known to have reached the board.
  IoResult deactivate() noexcept;

  /// The phase whose command is written next: for injected faults alone (InjectingDriver), no board needs to know.
  virtual void note_phase(rig::Phase /*phase*/) noexcept {}

  /// The longest that a failed `write`, or `deactivate`, waits for the board to confirm the safe state, ns. 0: it does
  /// not wait, the board's accesses are all that it takes.
  [[nodiscard]] virtual std::int64_t make_safe_bound_ns() const noexcept { return 0; }
  /// @param listener  outlives the driver's use, or null for none. Called by the thread that makes safe.
  virtual void tell_before_making_safe(MakingSafeListener* listener) noexcept { listener_ = listener; }

  [[nodiscard]] DriverState state() const noexcept { return state_; }
  [[nodiscard]] virtual std::string_view name() const noexcept = 0;
  /// The simulator's truth of the last `read`, for logs alone; NaN from hardware.
  [[nodiscard]] virtual rig::PlantTruth truth() const noexcept { return {}; }
  /// What `configure` found out about the board, a line each, for the log. Empty before it, and from a simulator.
  [[nodiscard]] virtual std::vector<std::string> notes() const { return {}; }
  /// What the run's traffic came to, a line each, for the log after a run. Empty from backends that count none.
  [[nodiscard]] virtual std::vector<std::string> tally() const { return {}; }
  /// What the rig does when the safe state did not reach the board, for people.
  [[nodiscard]] virtual std::string_view what_holds_unsafe() const noexcept {
    return "its PWMs may hold their last duties";
  }
  /// All that the configured board lets itself be asked without anything being written, a line each, for people.
  [[nodiscard]] virtual std::vector<std::string> inspection() { return {}; }

 private:
  virtual void do_configure() = 0;
  virtual void do_activate(std::int64_t now_ns) = 0;
  virtual IoResult do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept = 0;
  virtual IoResult do_write(const rig::Command& command) noexcept = 0;
  /// Writes the safe state whatever went before, and tries all outputs even when one fails.
  virtual IoResult do_make_safe() noexcept = 0;

  IoResult make_safe() noexcept;

  DriverState state_{DriverState::unconfigured};
  MakingSafeListener* listener_{nullptr};
};

}  // namespace abs_hil::driver
