#pragma once

#include <cstdint>
#include <memory>

#include "driver/board_options.hpp"
#include "driver/own_handle_writer.hpp"
#include "driver/pci/register_map.hpp"
#include "driver/pci/register_window.hpp"

namespace abs_hil::driver::pci {

/// Sets both PWMs of the RT-DAC4/PCI to width 0, then reads both back. Index and data are two accesses. A live owner
/// between them could send a width to the wrong PWM, or undo the safe state with its next width. Use this only when the
/// owner no longer writes, or writes only zeros.
class PciSafeState final : public OwnHandleWriter<std::unique_ptr<RegisterWindow>> {
 public:
  /// @param full_width  of a PWM: it also looks at both before it sets them; 0: it does not look
  explicit PciSafeState(Open open_window, std::uint32_t full_width = 0)
      : OwnHandleWriter(std::move(open_window)), full_width_(full_width) {}
  /// For the card that the options select, through sysfs.
  /// @param beside_guardian  it works although a guardian has the card, which writes zeros as well, and looks
  explicit PciSafeState(const PciOptions& options, bool beside_guardian = false);

  [[nodiscard]] std::string_view name() const noexcept override { return "pci"; }
  void prepare() override;
  [[nodiscard]] bool works_beside_owner() const noexcept override { return true; }
  /// Stays at the card, and lets an owner in.
  void let_go() noexcept override {
    if (handle_) handle_->refuse_owners(false);
  }
  void take_hold() noexcept override {
    if (handle_) handle_->refuse_owners(true);
  }

 private:
  [[nodiscard]] IoResult write_zeros() noexcept override;
  /// Four accesses: index and width of each PWM. The card has no way to show a width without its index.
  [[nodiscard]] IoResult look() noexcept override;
  /// The width of the PWM that it selects.
  [[nodiscard]] IoResult select(Pwm pwm, std::uint32_t& width) noexcept;
  [[nodiscard]] IoResult set_to_zero(Pwm pwm) noexcept;
  [[nodiscard]] IoResult check_for_zero(Pwm pwm) noexcept;

  std::uint32_t full_width_;
};

}  // namespace abs_hil::driver::pci
