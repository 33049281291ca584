#include "runtime/board_policy.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <stdexcept>
#include <string>

namespace abs_hil::runtime {

namespace {

/// Files of the kernel belong to real cards, even where driver.emulated says otherwise.
bool is_of_the_kernel(const std::string& folder) {
  std::error_code error;
  return std::filesystem::weakly_canonical(folder, error).string().starts_with("/sys/");
}

/// A network interface with a device behind it is an adapter. vcan has no device, and neither has a socket in place of
/// a bus.
bool is_an_adapter(const std::string& interface) {
  std::error_code ignored;
  return std::filesystem::exists("/sys/class/net/" + interface + "/device", ignored);
}

bool names_real_cards(const driver::DriverOptions& d) { return d.kind == "pci" && is_of_the_kernel(d.pci.root); }

bool names_an_adapter(const driver::DriverOptions& d) { return d.kind == "can" && is_an_adapter(d.can.interface); }

void refuse_virtual_time_on_hardware(const BoardUse& use) {
  if (!use.virtual_time || use.driver.emulated) return;
  throw std::invalid_argument(
      "--fast: the rig runs in real time only; leave it out, use --backend sim, or, for an emulator in lock-step "
      "(never for hardware), --set driver.emulated=true");
}

void refuse_start_speed(const BoardUse& use) {
  if (use.start_speed_rad_s <= 0.0) return;
  throw std::invalid_argument(
      "experiment.start_speed_rad_s: a real wheel does not start at speed; leave it out or use --backend sim");
}

/// A cycle must not wait for an answer longer than its period.
void refuse_slow_answers(const BoardUse& use) {
  const driver::usb::UsbOptions& usb = use.driver.usb;
  if (use.driver.kind != "usb" || use.virtual_time || usb.answer_timeout_us * use.rate_Hz < 1e6) return;
  throw std::invalid_argument(fmt::format(
      "driver.usb.answer_timeout_us = {}: a cycle must not wait longer than its period; give a value below {} "
      "or a lower control.rate_Hz",
      usb.answer_timeout_us, std::llround(1e6 / use.rate_Hz)));
}

void refuse_injection_into_hardware(const BoardUse& use) {
  if (use.injections.empty()) return;
  const driver::DriverOptions& d = use.driver;
  const std::string fault = driver::to_text(use.injections.front());
  if (!d.emulated) {
    throw std::invalid_argument(
        fmt::format("--inject {}: faults are never injected into real hardware; use --backend sim, or for an emulator "
                    "(never hardware) --set driver.emulated=true",
                    fault));
  }
  if (names_real_cards(d)) {
    throw std::invalid_argument(
        fmt::format("--inject {}: driver.emulated=true, but driver.pci.root = {} holds the real cards; give the "
                    "emulator's folder",
                    fault, d.pci.root));
  }
  if (names_an_adapter(d)) {
    throw std::invalid_argument(fmt::format(
        "--inject {}: driver.emulated=true, but driver.can.interface = {} is an adapter to a real bus; give "
        "a vcan interface or an emulator's socket",
        fault, d.can.interface));
  }
}

void refuse_hardware_without_guardian(const BoardUse& use) {
  if (use.guarded) return;
  const driver::DriverOptions& d = use.driver;
  if (d.emulated) {
    const std::string real = names_real_cards(d)   ? "driver.pci.root = " + d.pci.root
                             : names_an_adapter(d) ? "driver.can.interface = " + d.can.interface
                                                   : std::string();
    if (real.empty()) return;
    throw std::invalid_argument(fmt::format(
        "guardian.enabled = false: driver.emulated=true, but {} is real hardware, and real hardware needs a "
        "guardian; leave guardian.enabled out, or name the emulator's",
        real));
  }
  throw std::invalid_argument(
      "guardian.enabled = false: a real rig needs a guardian, because its PWMs may hold when the program dies; leave "
      "it "
      "out, or for an emulator (never hardware) --set driver.emulated=true");
}

void refuse_cap_above(std::string_view key, double value, std::string_view board, double board_value) {
  if (value <= board_value) return;
  throw std::invalid_argument(
      fmt::format("gate.{0} = {1}: the board sends at most {2} (driver.{3}.{0}); give a number "
                  "in (0, {2}]",
                  key, value, board_value, board));
}

/// The duty caps of the board that is driven. Throws std::invalid_argument for a board without caps: it is not driven.
DutyCaps caps_of(const driver::DriverOptions& d) {
  if (d.kind == "pci") return {d.pci.brake_duty_max, d.pci.motor_duty_max};
  if (d.kind == "can") return {d.can.brake_duty_max, d.can.motor_duty_max};
  if (d.kind == "usb") return {d.usb.brake_duty_max, d.usb.motor_duty_max};
  throw std::invalid_argument(
      fmt::format("driver.kind = {}: this board has no duty caps, so it is not driven", d.kind));
}

}  // namespace

bool is_real_board(const driver::DriverOptions& driver) {
  if (driver.kind == "usb") return !driver.emulated;
  return names_real_cards(driver) || names_an_adapter(driver);
}

void refuse_unsafe_use(const BoardUse& use) {
  refuse_virtual_time_on_hardware(use);
  refuse_start_speed(use);
  refuse_slow_answers(use);
  refuse_injection_into_hardware(use);
  refuse_hardware_without_guardian(use);
}

void refuse_caps_above_board(const DutyCaps& asked_for, const driver::DriverOptions& driver) {
  const DutyCaps board = caps_of(driver);
  refuse_cap_above("brake_duty_max", asked_for.brake, driver.kind, board.brake);
  refuse_cap_above("motor_duty_max", asked_for.motor, driver.kind, board.motor);
}

void apply_board_limits(const rig::RigParameters& rig, double rate_Hz, GateOptions& gate,
                        driver::DriverOptions& driver) {
  const DutyCaps board = caps_of(driver);
  gate.brake_duty_max = std::min(gate.brake_duty_max, board.brake);
  gate.motor_duty_max = std::min(gate.motor_duty_max, board.motor);
  driver.pci.encoder_counts_per_rev = rig.encoder_counts_per_rev;
  driver.can.encoder_counts_per_rev = rig.encoder_counts_per_rev;
  driver.usb.encoder_counts_per_rev = rig.encoder_counts_per_rev;
  driver.can.rate_Hz = rate_Hz;
}

}  // namespace abs_hil::runtime
