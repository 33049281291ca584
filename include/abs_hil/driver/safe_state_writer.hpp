#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "abs_hil/driver/io_result.hpp"
#include "abs_hil/rig/command.hpp"

namespace abs_hil::driver {

/// Brings a board into the safe state from a second process, with its own handle, after the process that owned the
/// board can no longer write. There is one class per kind of board. It must not share with the driver anything that a
/// crash could leave broken: no lock, no memory, no descriptor.
class SafeStateWriter {
 public:
  SafeStateWriter() = default;
  SafeStateWriter(SafeStateWriter&&) = delete;  // nor copied
  virtual ~SafeStateWriter() = default;

  [[nodiscard]] virtual std::string_view name() const noexcept = 0;
  /// Opens what can be opened while the owner has the board, and writes nothing. Call it before the owner activates the
  /// board. Throws Unavailable.
  virtual void prepare() = 0;
  /// Longest time that the owner takes to make the board safe, ns (RigDriver::make_safe_bound_ns). Call it after
  /// `prepare`.
  [[nodiscard]] virtual std::int64_t owner_needs_ns() const noexcept { return 0; }
  /// Writes drive 0, brake 0 and motor disabled; a failed write does not keep it from the others. Then it reads them
  /// back, or waits until the board reports them. `ok`: the safe state is verified. May be called repeatedly; opens the
  /// board again if its handle is dead, and does not wait for a board that is not there. It takes as long as the
  /// board's accesses. After `prepare` it allocates only when it opens the board.
  [[nodiscard]] virtual IoResult make_safe() noexcept = 0;
  /// A cheap look for every few ms while no owner may write; after an owner, call `make_safe` first. It writes to the
  /// outputs only if they are not zero. `ok`: both outputs are zero. `foreign_writer`: one was not; zeros have been
  /// written, and the next look tells whether they stay. Any other error, as from `make_safe`: the look could not tell,
  /// so zeros were written, and these are not verified either. By default, and for a board that cannot show its
  /// outputs, it is `make_safe`.
  [[nodiscard]] virtual IoResult verify_safe() noexcept { return make_safe(); }
  /// True if it can look at the outputs while another process has the board open, without disturbing that one.
  [[nodiscard]] virtual bool works_beside_owner() const noexcept { return false; }
  /// True if it does so, and tells duties from outputs that its owner has only permitted.
  [[nodiscard]] virtual bool tells_duties() const noexcept { return false; }
  /// Lets an owner in: closes a handle that would keep it from the board. The next call opens the board again.
  virtual void let_go() noexcept {}
  /// Keeps new owners away again.
  virtual void take_hold() noexcept {}
  /// The outputs as the last `make_safe` found them before its zeros; nothing if the writer does not look.
  [[nodiscard]] virtual std::optional<rig::Command> found() const noexcept { return std::nullopt; }
};

}  // namespace abs_hil::driver
