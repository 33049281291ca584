#include "driver/factory.hpp"

#include <array>
#include <vector>

#include "driver/can/can_driver.hpp"
#include "driver/can/link.hpp"
#include "driver/monotonic_time.hpp"
#include "driver/pci/discovery.hpp"
#include "driver/pci/pci_driver.hpp"
#include "driver/pci/pci_safe_state.hpp"
#include "driver/take_over_writer.hpp"
#include "driver/usb/urb_link.hpp"
#include "driver/usb/usb_driver.hpp"

namespace abs_hil::driver {

std::span<const BackendEntry> backends() noexcept {
  static constexpr std::array<BackendEntry, 2> entries{{
      {"sim", "the simulated rig, at the level of encoder counts and duty cycles"},
      {"rig", "the real rig, behind the board that driver.kind names"},
  }};
  return entries;
}

std::span<const BackendEntry> boards() noexcept {
  static constexpr std::array<BackendEntry, 3> entries{{
      {"pci", "RT-DAC4/PCI with ABS logic; unverified on hardware"},
      {"can", "CAN I/O node of this project's own protocol (docs/can.md); unverified on hardware"},
      {"usb", "RT-DAC/USB2 with generic logic; unverified on hardware"},
  }};
  return entries;
}

std::string_view board_name(std::size_t index) noexcept {
  return index < boards().size() ? boards()[index].name : std::string_view{};
}

namespace {
[[noreturn]] void refuse_kind(const std::string& kind) {
  throw Unavailable("backend rig: driver.kind = \"" + kind +
                    "\": this build has no driver for that board; use driver.kind=pci, can or usb, or --backend sim");
}
}  // namespace

OutputGrid output_grid(const DriverOptions& options) {
  if (options.kind == "pci") return pwm_grid(options.pci);
  if (options.kind == "can") return can::output_grid(options.can);
  if (options.kind == "usb") return pwm_grid(options.usb);
  refuse_kind(options.kind);
}

OutputGrid simulated_output_grid(const DriverOptions& options, bool any_brake_duty) {
  return {.duty_steps = full_width(pwm_mode_named(options.sim.pwm_mode)), .any_brake_duty = any_brake_duty};
}

std::unique_ptr<RigDriver> make_rig_driver(const DriverOptions& options, bool lock_step) {
  if (options.kind == "pci") {
    return std::make_unique<pci::PciDriver>(
        options.pci, [pci = options.pci, lock_step] { return pci::open_card(pci, lock_step); },
        lock_step ? nullptr : monotonic_ns);
  }
  if (options.kind == "can") {
    return std::make_unique<can::CanDriver>(
        options.can, [can = options.can] { return can::open_link(can); }, lock_step);
  }
  if (options.kind == "usb") {
    return std::make_unique<usb::UsbDriver>(
        options.usb,
        [usb = options.usb, lock_step, emulated = options.emulated] {
          return usb::open_board(usb, lock_step, emulated);
        },
        lock_step ? nullptr : monotonic_ns);
  }
  refuse_kind(options.kind);
}

std::string verification_note(const DriverOptions& options) {
  if (options.verified_on_hardware) return {};
  if (options.kind == "can") {
    return "backend rig, driver.kind=can: not verified on hardware. The protocol is this project's own (docs/can.md) "
           "and has been tested only with an emulated node. Do the checks of docs/can.md, \"What is not verified\", "
           "then "
           "set driver.verified_on_hardware=true";
  }
  if (options.kind == "usb") {
    return "backend rig, driver.kind=usb: not verified on hardware. The frame format comes from the maker's documents "
           "and has been tested only with an emulator. The board has no known watchdog. Do the checks of docs/usb.md "
           "and "
           "docs/rig-setup.md with abs_hil commission, then set driver.verified_on_hardware=true";
  }
  return "backend rig, driver.kind=" + options.kind +
         ": not verified on hardware. The register map comes from the maker's documents and has been tested only with "
         "an emulator. Do the checks of docs/rig-setup.md with abs_hil commission, then set "
         "driver.verified_on_hardware=true";
}

std::unique_ptr<SafeStateWriter> make_safe_state_writer(const DriverOptions& options) {
  if (options.kind == "pci") return std::make_unique<pci::PciSafeState>(options.pci);
  return std::make_unique<TakeOverWriter>([options] { return make_rig_driver(options); });
}

}  // namespace abs_hil::driver
