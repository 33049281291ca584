#pragma once

#include <functional>
#include <memory>
#include <string>

#include "abs_hil/driver/safe_state_writer.hpp"
#include "driver/pci/options.hpp"
#include "driver/pci/register_map.hpp"
#include "driver/pci/register_window.hpp"

namespace abs_hil::driver::pci {

/// Sets both PWMs of the RT-DAC4/PCI to width 0, then reads both back. Index and data are two accesses. A live owner
/// between them could send a width to the wrong PWM, or undo the safe state with its next width. Use this only when the
/// owner no longer writes, or writes only zeros.
class PciSafeState final : public SafeStateWriter {
 public:
  using OpenWindow = std::function<std::unique_ptr<RegisterWindow>()>;
  /// @param open_window  throws Unavailable, or returns null at little cost if it has looked for the card just before;
  ///                     called by `prepare`, and again after failed accesses
  /// @param full_width  of a PWM: it also looks at both before it sets them; 0: it does not look
  explicit PciSafeState(OpenWindow open_window, std::uint32_t full_width = 0)
      : open_window_(std::move(open_window)), full_width_(full_width) {}
  /// For the card that the options select, through sysfs.
  /// @param beside_guardian  it works although a guardian has the card, which writes zeros as well, and looks
  explicit PciSafeState(const PciOptions& options, bool beside_guardian = false);

  [[nodiscard]] std::string_view name() const noexcept override { return "pci"; }
  void prepare() override;
  [[nodiscard]] bool works_beside_owner() const noexcept override { return true; }
  /// Stays at the card, and lets an owner in.
  void let_go() noexcept override {
    if (window_) window_->refuse_owners(false);
  }
  void take_hold() noexcept override {
    if (window_) window_->refuse_owners(true);
  }
  [[nodiscard]] IoResult make_safe() noexcept override;
  /// Four accesses: index and width of each PWM. The card has no way to show a width without its index.
  [[nodiscard]] IoResult verify_safe() noexcept override;
  [[nodiscard]] std::optional<rig::Command> found() const noexcept override { return found_; }

 private:
  [[nodiscard]] IoResult open_again() noexcept;
  /// The duty of the PWM that the index selects; 0 if it cannot be read.
  [[nodiscard]] double look() noexcept;
  [[nodiscard]] IoResult set_to_zero(Pwm pwm) noexcept;

  OpenWindow open_window_;
  std::uint32_t full_width_;
  std::optional<rig::Command> found_{};
  std::unique_ptr<RegisterWindow> window_{};
};

}  // namespace abs_hil::driver::pci
