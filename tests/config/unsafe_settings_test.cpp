#include "config/unsafe_settings.hpp"

#include <filesystem>

#include "catch.hpp"
#include "config/config_error.hpp"

using namespace abs_hil::config;
using Catch::Matchers::Contains;

namespace {

std::string refusal(Settings settings) {
  const KeyTable keys(settings);
  try {
    refuse_unsafe(settings, keys);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return {};
}

Settings without_guardian() {
  Settings settings;
  settings.backend = "rig";
  settings.guardian.enabled = false;
  return settings;
}

/// A network interface of this computer with a device behind it; empty if it has none.
std::string an_adapter() {
  for (const auto& entry : std::filesystem::directory_iterator("/sys/class/net")) {
    if (std::filesystem::exists(entry.path() / "device")) return entry.path().filename();
  }
  return {};
}

}  // namespace

TEST_CASE("Hardware needs a guardian, whatever driver.emulated says") {
  Settings settings = without_guardian();
  CHECK_THAT(refusal(settings), Contains("or for an emulator (never hardware) --set driver.emulated=true"));
  settings.driver.emulated = true;
  settings.driver.kind = "pci";
  settings.driver.pci.root = "/sys/bus/pci/devices";
  CHECK_THAT(refusal(settings), Contains("driver.pci.root = /sys/bus/pci/devices is real hardware"));
  settings.driver.pci.root = "/tmp";
  CHECK(refusal(settings).empty());
  settings.driver.kind = "can";
  settings.driver.can.interface = "unix:/tmp/bus";
  CHECK(refusal(settings).empty());
}

TEST_CASE("An adapter to a real bus is hardware") {
  Settings settings = without_guardian();
  settings.driver.emulated = true;
  settings.driver.kind = "can";
  settings.driver.can.interface = an_adapter();
  if (settings.driver.can.interface.empty()) {
    WARN("this computer has no network adapter to try it with");
    return;
  }
  CHECK_THAT(refusal(settings), Contains("driver.can.interface = ") && Contains("is real hardware"));
  settings.guardian.enabled = true;
  CHECK(refusal(settings).empty());
}

TEST_CASE("Faults are injected into simulations and emulators only") {
  Settings settings;
  settings.inject = "brake@encoder_upper:stuck";
  CHECK(refusal(settings).empty());
  settings.backend = "rig";
  CHECK_THAT(refusal(settings), Contains("--inject") && Contains("never injected into real hardware"));
  settings.driver.emulated = true;
  settings.driver.kind = "pci";
  settings.driver.pci.root = "/sys/bus/pci/devices";
  CHECK_THAT(refusal(settings), Contains("driver.pci.root = /sys/bus/pci/devices holds the real cards"));
  settings.driver.pci.root = "/tmp";
  CHECK(refusal(settings).empty());
  settings.driver.kind = "can";
  settings.driver.can.interface = "unix:/tmp/bus";
  CHECK(refusal(settings).empty());
  settings.driver.can.interface = an_adapter();
  if (settings.driver.can.interface.empty()) {
    WARN("this computer has no network adapter to try it with");
    return;
  }
  CHECK_THAT(refusal(settings), Contains("is an adapter to a real bus; give a vcan interface"));
}
