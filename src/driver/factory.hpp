#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "abs_hil/driver/rig_driver.hpp"
#include "abs_hil/driver/safe_state_writer.hpp"
#include "driver/can/options.hpp"
#include "driver/pci/options.hpp"
#include "driver/usb/options.hpp"

namespace abs_hil::driver {

/// Everything below `driver.` in the configuration.
struct DriverOptions {
  std::string kind{"pci"};  ///< the board behind `--backend rig`
  /// The board is an emulator. With `--fast` the driver advances its time in lock-step. Refused on hardware.
  bool emulated{false};
  /// A lab sets this after the checks of docs/rig-setup.md on its own rig. Until then doctor and log give a warning.
  bool verified_on_hardware{false};
  pci::PciOptions pci{};
  can::CanOptions can{};
  usb::UsbOptions usb{};
};

struct BackendEntry {
  std::string_view name;
  std::string_view summary;
};
/// Values of `--backend`. Callers make a SimDriver themselves for the simulated one: only driver/sim knows the plant.
[[nodiscard]] std::span<const BackendEntry> backends() noexcept;

/// Values of `driver.kind`.
[[nodiscard]] std::span<const BackendEntry> boards() noexcept;

/// Makes the driver of the board that `options.kind` names; its `configure` looks for the board. Throws
/// std::invalid_argument for an option outside its range, Unavailable for a kind without a driver in this build.
/// @param lock_step  the driver advances an emulator's time (`options.emulated`, `--fast`)
[[nodiscard]] std::unique_ptr<RigDriver> make_rig_driver(const DriverOptions& options, bool lock_step = false);

/// Makes the writer of the safe state for the board that `options.kind` names. Throws Unavailable for a kind without
/// one in this build.
[[nodiscard]] std::unique_ptr<SafeStateWriter> make_safe_state_writer(const DriverOptions& options);

/// The warning "not verified on hardware ..."; empty if `verified_on_hardware` is set.
[[nodiscard]] std::string verification_note(const DriverOptions& options);

}  // namespace abs_hil::driver
