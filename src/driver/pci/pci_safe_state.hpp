#pragma once

#include <functional>
#include <memory>
#include <string>

#include "abs_hil/driver/safe_state_writer.hpp"
#include "driver/pci/options.hpp"
#include "driver/pci/register_window.hpp"

namespace abs_hil::driver::pci {

/// Sets both PWMs of the RT-DAC4/PCI to width 0, then reads both back. Index and data are two accesses. A live owner
/// between them could send a width to the wrong PWM, or undo the safe state with its next width. Use this only when the
/// owner no longer writes, or writes only zeros.
class PciSafeState final : public SafeStateWriter {
 public:
  using OpenWindow = std::function<std::unique_ptr<RegisterWindow>()>;
  /// @param open_window  throws Unavailable; called by `prepare`, and again after failed accesses
  explicit PciSafeState(OpenWindow open_window) : open_window_(std::move(open_window)) {}
  /// For the card that the options select, through sysfs.
  /// @param beside_guardian  it works although a guardian has the card, which writes zeros as well
  explicit PciSafeState(const PciOptions& options, bool beside_guardian = false);

  [[nodiscard]] std::string_view name() const noexcept override { return "pci"; }
  void prepare() override;
  [[nodiscard]] IoResult make_safe() noexcept override;

 private:
  [[nodiscard]] IoResult open_again() noexcept;

  OpenWindow open_window_;
  std::unique_ptr<RegisterWindow> window_{};
};

}  // namespace abs_hil::driver::pci
