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
  /// The board is an emulator. With `--fast` its time is driven in lock-step; refused where there is no emulator.
  bool emulated{false};
  /// Set by a lab that has gone through docs/rig-setup.md on its own rig; until then doctor and log say otherwise.
  bool verified_on_hardware{false};
  pci::PciOptions pci{};
  can::CanOptions can{};
  usb::UsbOptions usb{};
};

struct BackendEntry {
  std::string_view name;
  std::string_view summary;
};
/// What `--backend` takes. The simulated one is made by `SimDriver` itself: only driver/sim knows the plant.
[[nodiscard]] std::span<const BackendEntry> backends() noexcept;

/// The boards that `driver.kind` knows.
[[nodiscard]] std::span<const BackendEntry> boards() noexcept;

/// The rig behind the board that `options.kind` names; its `configure` looks for the board. Throws
/// std::invalid_argument for an option outside its range, Unavailable for a kind that this build does not drive.
/// @param lock_step  drive an emulator's time (`options.emulated`, `--fast`)
[[nodiscard]] std::unique_ptr<RigDriver> make_rig_driver(const DriverOptions& options, bool lock_step = false);

/// The writer of the safe state for the board that `options.kind` names. Throws Unavailable for a kind that has none in
/// this build.
[[nodiscard]] std::unique_ptr<SafeStateWriter> make_safe_state_writer(const DriverOptions& options);

/// "not verified on hardware ..." until the configuration says otherwise; empty then.
[[nodiscard]] std::string verification_note(const DriverOptions& options);

}  // namespace abs_hil::driver
