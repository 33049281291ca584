#pragma once

#include <cstdint>
#include <string_view>

#include "abs_hil/driver/io_result.hpp"

namespace abs_hil::driver {

/// Brings a board into the safe state from a second process, with a handle of its own, once the process that owned the
/// board can write no more. One for each kind of board. What it must not do is share anything with the driver that a
/// crash could leave broken: no lock, no memory, no descriptor.
class SafeStateWriter {
 public:
  SafeStateWriter() = default;
  SafeStateWriter(const SafeStateWriter&) = delete;
  SafeStateWriter& operator=(const SafeStateWriter&) = delete;
  virtual ~SafeStateWriter() = default;

  [[nodiscard]] virtual std::string_view name() const noexcept = 0;
  /// Opens what can be opened beside the owner, and writes nothing. Before anything is activated. Throws Unavailable.
  virtual void prepare() = 0;
  /// The longest that the board's owner takes to make it safe, ns (RigDriver::make_safe_bound_ns). After `prepare`.
  [[nodiscard]] virtual std::int64_t owner_needs_ns() const noexcept { return 0; }
  /// Drive 0, brake 0, motor disabled, each tried whatever became of the others, then read back (or, where the board
  /// tells of itself only, seen in what it says). `ok` means: known to be so. May be called again and again; opens the
  /// board anew if its handle has died. Bounded by what the board's accesses take.
  [[nodiscard]] virtual IoResult make_safe() noexcept = 0;
};

}  // namespace abs_hil::driver
