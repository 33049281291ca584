// What the safe-state writers of all boards share: a handle of their own, opened again when the board was gone.

#pragma once

#include <unistd.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>

#include "abs_hil/driver/safe_state_writer.hpp"
#include "driver/monotonic_time.hpp"

namespace abs_hil::driver {

/// When a safe-state writer looks again for a board that is gone. A guard calls it every few ms, and looking for a
/// board reads many files and allocates. So it looks every 100 ms; and every 5 ms at most as long as there is a file
/// that only the present board has. A call that is not due costs one system call.
class Reopening {
 public:
  using ReadClock = std::int64_t (*)() noexcept;
  explicit Reopening(std::string file = {}, ReadClock read_clock = monotonic_ns)
      : file_(std::move(file)), read_clock_(read_clock) {}

  /// True if the board should be looked for now; then it is not due again for a while.
  [[nodiscard]] bool due() noexcept {
    const std::int64_t now_ns = read_clock_();
    const bool there = !file_.empty() && ::access(file_.c_str(), F_OK) == 0;
    if (tried_ && now_ns - tried_ns_ < (there ? near_ns : far_ns)) return false;
    tried_ = true;
    tried_ns_ = now_ns;
    return true;
  }
  /// The file that shows the board which was found.
  void found(std::string file) { file_ = std::move(file); }

 private:
  static constexpr std::int64_t near_ns = 5'000'000;
  static constexpr std::int64_t far_ns = 100'000'000;
  std::string file_;
  ReadClock read_clock_;
  bool tried_{false};
  std::int64_t tried_ns_{0};
};

/// A safe-state writer with a handle of its own. `Handle` converts to true while it is open.
template <class Handle>
class OwnHandleWriter : public SafeStateWriter {
 public:
  /// Throws Unavailable, or returns an empty handle at little cost if it has looked for the board just before.
  using Open = std::function<Handle()>;
  explicit OwnHandleWriter(Open open) : open_(std::move(open)) {}

  [[nodiscard]] IoResult make_safe() noexcept final {
    found_.reset();
    if (!handle_ && !open()) return {IoError::disconnected};
    const IoResult result = write_zeros();
    if (result.error == IoError::disconnected) handle_ = {};
    return result;
  }
  [[nodiscard]] IoResult verify_safe() noexcept final {
    const IoResult seen = handle_ ? look() : IoResult{IoError::disconnected};
    if (seen.ok()) return seen;
    const IoResult made_safe = make_safe();
    return seen.error == IoError::foreign_writer ? seen : made_safe;
  }
  [[nodiscard]] std::optional<rig::Command> found() const noexcept final { return found_; }

 protected:
  /// Writes zeros to the open board, whatever fails, and verifies them. After `disconnected` the handle is closed.
  virtual IoResult write_zeros() noexcept = 0;
  /// Looks at the outputs of the open board without writing to them. `foreign_writer`: one is not zero. Any other
  /// error: it cannot tell.
  virtual IoResult look() noexcept = 0;
  /// Called after the board was opened.
  virtual void opened() noexcept {}
  [[nodiscard]] static IoResult foreign_output(std::uint32_t where) noexcept {
    return {IoError::foreign_writer, where, 0, rig::Reason::foreign_writer};
  }

  Handle handle_{};
  std::optional<rig::Command> found_{};

  /// May throw; for `prepare`.
  void open_now() {
    handle_ = open_();
    if (handle_) opened();
  }

 private:
  [[nodiscard]] bool open() noexcept {
    try {
      open_now();
    } catch (...) {
      handle_ = {};
    }
    return static_cast<bool>(handle_);
  }

  Open open_;
};

}  // namespace abs_hil::driver
