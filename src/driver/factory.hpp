#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "abs_hil/driver/rig_driver.hpp"
#include "abs_hil/driver/safe_state_writer.hpp"
#include "abs_hil/rig/option.hpp"
#include "driver/can/options.hpp"
#include "driver/pci/options.hpp"
#include "driver/usb/options.hpp"

namespace abs_hil::driver {

/// Name number `index` of `boards()`; empty beyond the last.
[[nodiscard]] std::string_view board_name(std::size_t index) noexcept;

/// Everything below `driver.` in the configuration.
struct DriverOptions {
  ABS_HIL_OPTIONS(DriverOptions);
  ABS_HIL_OPTION(std::string, kind, "pci", .meaning = "board behind --backend rig", .allowed = board_name);
  /// Refused where there is no emulator.
  ABS_HIL_OPTION(bool, emulated, false, .meaning = "the board is an emulator: --fast may drive its time in lock-step");
  /// Until then doctor and log say otherwise.
  ABS_HIL_OPTION(bool, verified_on_hardware, false,
                 .meaning = "this lab has gone through docs/rig-setup.md on its own rig");
  ABS_HIL_GROUP(pci::PciOptions, pci, "pci.", {});
  ABS_HIL_GROUP(can::CanOptions, can, "can.", {});
  ABS_HIL_GROUP(usb::UsbOptions, usb, "usb.", {});
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
