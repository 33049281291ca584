#include "config/unsafe_settings.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "config/config_error.hpp"

namespace abs_hil::config {

namespace {

/// The kernel's own files belong to real cards, whatever driver.emulated says.
bool is_of_the_kernel(const std::string& folder) {
  std::error_code error;
  return std::filesystem::weakly_canonical(folder, error).string().starts_with("/sys/");
}

/// A network interface with a device is an adapter to a real bus. Neither vcan nor a socket has a device.
bool is_an_adapter(const std::string& interface) {
  std::error_code ignored;
  return std::filesystem::exists("/sys/class/net/" + interface + "/device", ignored);
}

bool names_real_cards(const Settings& s) { return s.driver.kind == "pci" && is_of_the_kernel(s.driver.pci.root); }

bool names_an_adapter(const Settings& s) { return s.driver.kind == "can" && is_an_adapter(s.driver.can.interface); }

void refuse_injection_into_hardware(const Settings& s) {
  const std::vector<driver::Injection> injections = injections_of(s);
  if (injections.empty() || s.backend != "rig") return;
  const std::string fault = driver::to_text(injections.front());
  if (!s.driver.emulated) {
    throw ConfigError(
        fmt::format("--inject {}: faults are never injected into real hardware; use --backend sim, or for an emulator "
                    "(never hardware) --set driver.emulated=true",
                    fault));
  }
  if (names_real_cards(s)) {
    throw ConfigError(
        fmt::format("--inject {}: driver.emulated=true, but driver.pci.root = {} holds the real cards; give the "
                    "emulator's folder",
                    fault, s.driver.pci.root));
  }
  if (names_an_adapter(s)) {
    throw ConfigError(fmt::format(
        "--inject {}: driver.emulated=true, but driver.can.interface = {} is an adapter to a real bus; give "
        "a vcan interface or an emulator's socket",
        fault, s.driver.can.interface));
  }
}

void refuse_hardware_without_guardian(const Settings& s) {
  if (s.backend != "rig" || s.guardian.enabled) return;
  if (s.driver.emulated) {
    const std::string real = names_real_cards(s)   ? "driver.pci.root = " + s.driver.pci.root
                             : names_an_adapter(s) ? "driver.can.interface = " + s.driver.can.interface
                                                   : std::string();
    if (real.empty()) return;
    throw ConfigError(fmt::format(
        "guardian.enabled = false: driver.emulated=true, but {} is real hardware, which needs a guardian; leave it "
        "out, or name the emulator's",
        real));
  }
  throw ConfigError(
      "guardian.enabled = false: a real rig needs a guardian, because its PWMs may hold their values when the "
      "program dies; leave it out, or for an emulator (never hardware) --set driver.emulated=true");
}

void refuse_cap_above_board(const KeyTable& keys, std::string_view key, double value, std::string_view board_key,
                            double board_value) {
  if (!keys.was_set(key) || value <= board_value) return;
  throw ConfigError(fmt::format("{} = {}: the board sends at most {} ({}); give a number in (0, {}]", key, value,
                                board_value, board_key, board_value));
}

template <typename BoardOptions>
void refuse_caps_above(const Settings& s, const KeyTable& keys, const BoardOptions& board) {
  const std::string prefix = "driver." + s.driver.kind + '.';
  refuse_cap_above_board(keys, "gate.brake_duty_max", s.gate.brake_duty_max, prefix + "brake_duty_max",
                         board.brake_duty_max);
  refuse_cap_above_board(keys, "gate.motor_duty_max", s.gate.motor_duty_max, prefix + "motor_duty_max",
                         board.motor_duty_max);
}

}  // namespace

std::vector<driver::Injection> injections_of(const Settings& settings) {
  return driver::parse_injections(settings.inject);
}

void refuse_unsafe(const Settings& s, const KeyTable& keys) {
  refuse_injection_into_hardware(s);
  refuse_hardware_without_guardian(s);
  if (s.backend != "rig") return;
  if (s.driver.kind == "pci") refuse_caps_above(s, keys, s.driver.pci);
  if (s.driver.kind == "can") refuse_caps_above(s, keys, s.driver.can);
  if (s.driver.kind == "usb") refuse_caps_above(s, keys, s.driver.usb);
}

}  // namespace abs_hil::config
