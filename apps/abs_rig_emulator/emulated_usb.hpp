#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "control.hpp"
#include "driver/file_descriptor.hpp"
#include "emulator/usb_board_model.hpp"
#include "emulator/usbip_device.hpp"

namespace abs_hil::program {

/// Options of the emulated USB board.
struct UsbEmulatorOptions {
  emulator::UsbBoardOptions board{};
  emulator::UsbIdentity identity{};
  std::string controller{"/sys/devices/platform/vhci_hcd.0"};  ///< the kernel's virtual host controller
  std::uint64_t seed{1};
  bool lock_step{false};
  std::string truth_file{};                 ///< CSV of true values that no frame shows; empty: none
  std::vector<std::string> when_braking{};  ///< commands obeyed once the brake has acted for 0.3 s
};

/// The board, plugged into this computer's virtual USB host controller (vhci_hcd) through a socket pair.
class EmulatedUsb {
 public:
  /// Plugs the board in. Throws std::invalid_argument, or std::runtime_error if there is no usable host controller.
  explicit EmulatedUsb(const UsbEmulatorOptions& options);

  [[nodiscard]] int descriptor() const { return host_.get(); }
  bool serve();
  void catch_up();
  std::string obey(std::string_view line);
  [[nodiscard]] std::string status() const;
  [[nodiscard]] std::string place() const;
  [[nodiscard]] static std::span<const ControlRow<EmulatedUsb>> rows();
  [[nodiscard]] emulator::UsbBoardModel& model() noexcept { return board_; }

 private:
  void plug_in();
  void unplug();
  void go_on_to(std::int64_t time_ns);
  void run_commands_when_braking();
  void send(const std::vector<std::uint8_t>& replies);

  UsbEmulatorOptions options_;
  emulator::UsbBoardModel board_;
  emulator::UsbipDevice device_;
  driver::FileDescriptor host_{-1};
  std::int64_t brake_since_ns_{-1};
  BoardTime time_;
};

}  // namespace abs_hil::program
