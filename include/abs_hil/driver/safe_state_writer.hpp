#pragma once

#include <cstdint>
#include <string_view>

#include "abs_hil/driver/io_result.hpp"

namespace abs_hil::driver {

/// Brings a board into the safe state from a second process, with its own handle, after the process that owned the
/// board can no longer write. There is one class per kind of board. It must not share with the driver anything that a
/// crash could leave broken: no lock, no memory, no descriptor.
class SafeStateWriter {
 public:
  SafeStateWriter() = default;
  SafeStateWriter(const SafeStateWriter&) = delete;
  SafeStateWriter& operator=(const SafeStateWriter&) = delete;
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
  /// board again if its handle is dead. It takes as long as the board's accesses.
  [[nodiscard]] virtual IoResult make_safe() noexcept = 0;
};

}  // namespace abs_hil::driver
