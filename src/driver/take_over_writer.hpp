#pragma once

#include <functional>
#include <memory>
#include <utility>

#include "abs_hil/driver/rig_driver.hpp"
#include "abs_hil/driver/safe_state_writer.hpp"

namespace abs_hil::driver {

/// Writes the safe state of a board that has only one owner at a time, or needs a handshake. After the owner's end it
/// takes the board over with its own driver: `activate` makes the outputs safe and `deactivate` verifies it. It cannot
/// open the board beforehand, so the first try takes as long as the board's `configure` and `activate`.
class TakeOverWriter final : public SafeStateWriter {
 public:
  using MakeDriver = std::function<std::unique_ptr<RigDriver>()>;
  /// @param make_driver  throws std::invalid_argument or Unavailable
  explicit TakeOverWriter(MakeDriver make_driver) : make_driver_(std::move(make_driver)) {}

  [[nodiscard]] std::string_view name() const noexcept override { return "take-over"; }
  void prepare() override { driver_ = make_driver_(); }
  [[nodiscard]] std::int64_t owner_needs_ns() const noexcept override {
    return driver_ ? driver_->make_safe_bound_ns() : 0;
  }
  void let_go() noexcept override { driver_.reset(); }
  [[nodiscard]] IoResult make_safe() noexcept override;

 private:
  MakeDriver make_driver_;
  std::unique_ptr<RigDriver> driver_{};
};

}  // namespace abs_hil::driver
