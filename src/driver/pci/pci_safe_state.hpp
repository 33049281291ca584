#pragma once

#include <functional>
#include <memory>
#include <string>

#include "abs_hil/driver/safe_state_writer.hpp"
#include "driver/pci/options.hpp"
#include "driver/pci/register_window.hpp"

namespace abs_hil::driver::pci {

/// Both PWMs of the RT-DAC4/PCI to width 0, read back in a second round. Index and data are two accesses: with an owner
/// alive between them, a width meant for one PWM could go to the other, or the owner's next width undo the safe state.
/// So this must run only when the owner writes no more, or zeros only.
class PciSafeState final : public SafeStateWriter {
 public:
  using OpenWindow = std::function<std::unique_ptr<RegisterWindow>()>;
  /// @param open_window  throws Unavailable; called by `prepare`, and again after accesses failed
  explicit PciSafeState(OpenWindow open_window) : open_window_(std::move(open_window)) {}
  /// The card that the options mean, through sysfs.
  explicit PciSafeState(const PciOptions& options);

  [[nodiscard]] std::string_view name() const noexcept override { return "pci"; }
  void prepare() override;
  [[nodiscard]] IoResult make_safe() noexcept override;

 private:
  [[nodiscard]] IoResult open_again() noexcept;

  OpenWindow open_window_;
  std::unique_ptr<RegisterWindow> window_{};
};

}  // namespace abs_hil::driver::pci
