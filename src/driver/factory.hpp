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
#include "driver/output_grid.hpp"
#include "driver/pci/options.hpp"
#include "driver/sim_options.hpp"
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
  ABS_HIL_GROUP(SimOptions, sim, "sim.", {});
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

/// What the outputs make of a command: those of the board that `options.kind` names, or of the simulated rig with
/// `any_brake_duty` for its ideal actuator. Throws Unavailable for a kind without a driver in this build.
[[nodiscard]] OutputGrid output_grid(const DriverOptions& options);
[[nodiscard]] OutputGrid simulated_output_grid(const DriverOptions& options, bool any_brake_duty);

/// Makes the writer of the safe state for the board that `options.kind` names. Throws Unavailable for a kind without
/// one in this build.
[[nodiscard]] std::unique_ptr<SafeStateWriter> make_safe_state_writer(const DriverOptions& options);

/// The warning "not verified on hardware ..."; empty if `verified_on_hardware` is set.
[[nodiscard]] std::string verification_note(const DriverOptions& options);

}  // namespace abs_hil::driver
