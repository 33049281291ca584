#include "runtime/board_policy.hpp"

#include <filesystem>
#include <stdexcept>
#include <string>

#include "catch.hpp"

using namespace abs_hil;
using Catch::Matchers::Contains;

namespace {

/// What a run wants of a board, and the policy's answer: empty if it is allowed.
struct Asked {
  driver::DriverOptions driver{};
  bool guarded{true};
  bool virtual_time{false};
  double start_speed_rad_s{0.0};
  std::string inject{};

  [[nodiscard]] std::string refusal() const {
    try {
      runtime::refuse_unsafe_use({.driver = driver,
                                  .guarded = guarded,
                                  .virtual_time = virtual_time,
                                  .rate_Hz = 1000.0,
                                  .start_speed_rad_s = start_speed_rad_s,
                                  .injections = driver::parse_injections(inject)});
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return {};
  }
};

/// A network interface of this computer with a device behind it; empty if it has none.
std::string an_adapter() {
  for (const auto& entry : std::filesystem::directory_iterator("/sys/class/net")) {
    if (std::filesystem::exists(entry.path() / "device")) return entry.path().filename();
  }
  return {};
}

}  // namespace

TEST_CASE("Hardware is not driven without a guardian, even where it is called an emulator") {
  Asked run{.guarded = false};
  CHECK_THAT(run.refusal(), Contains("--set driver.emulated=true"));
  run.driver.emulated = true;
  run.driver.kind = "pci";
  run.driver.pci.root = "/sys/bus/pci/devices";
  CHECK_THAT(run.refusal(), Contains("driver.pci.root = /sys/bus/pci/devices is real hardware"));
  run.driver.pci.root = "/tmp";
  CHECK(run.refusal().empty());
  run.driver.kind = "can";
  run.driver.can.interface = "unix:/tmp/bus";
  CHECK(run.refusal().empty());
}

TEST_CASE("A board is real unless its files, its interface or the configuration say that it is an emulator") {
  driver::DriverOptions board;
  board.kind = "pci";
  board.pci.root = "/sys/bus/pci/devices";
  CHECK(runtime::is_real_board(board));
  board.emulated = true;  // the kernel's cards are real whatever the configuration says
  CHECK(runtime::is_real_board(board));
  board.emulated = false;
  board.pci.root = "/tmp/emulated/pci";
  CHECK_FALSE(runtime::is_real_board(board));

  board.kind = "can";
  for (const char* bus : {"unix:/tmp/bus", "vcan-that-is-not-there"}) {
    board.can.interface = bus;
    CHECK_FALSE(runtime::is_real_board(board));
  }
  if (const std::string adapter = an_adapter(); !adapter.empty()) {
    board.can.interface = adapter;
    CHECK(runtime::is_real_board(board));
  }

  board.kind = "usb";
  CHECK(runtime::is_real_board(board));
  board.emulated = true;
  CHECK_FALSE(runtime::is_real_board(board));
}

TEST_CASE("An adapter to a real bus is hardware") {
  Asked run{.guarded = false};
  run.driver.emulated = true;
  run.driver.kind = "can";
  run.driver.can.interface = an_adapter();
  if (run.driver.can.interface.empty()) {
    WARN("this computer has no network adapter to try it with");
    return;
  }
  CHECK_THAT(run.refusal(), Contains("driver.can.interface = ") && Contains("is real hardware"));
  run.guarded = true;
  CHECK(run.refusal().empty());
}

TEST_CASE("Faults are injected into emulators alone") {
  Asked run{.inject = "brake@encoder_upper:stuck"};
  CHECK_THAT(run.refusal(), Contains("--inject") && Contains("never injected into real hardware"));
  run.driver.emulated = true;
  run.driver.kind = "pci";
  run.driver.pci.root = "/sys/bus/pci/devices";
  CHECK_THAT(run.refusal(), Contains("driver.pci.root = /sys/bus/pci/devices holds the real cards"));
  run.driver.pci.root = "/tmp";
  CHECK(run.refusal().empty());
  run.driver.kind = "can";
  run.driver.can.interface = "unix:/tmp/bus";
  CHECK(run.refusal().empty());
  run.driver.can.interface = an_adapter();
  if (run.driver.can.interface.empty()) {
    WARN("this computer has no network adapter to try it with");
    return;
  }
  CHECK_THAT(run.refusal(), Contains("is an adapter to a real bus; give a vcan interface"));
}

TEST_CASE("Hardware runs in real time, from standstill, and waits no longer than a period") {
  Asked run{.virtual_time = true};
  CHECK_THAT(run.refusal(), Contains("--fast"));
  run.driver.emulated = true;
  CHECK(run.refusal().empty());
  run = {.start_speed_rad_s = 170.0};
  CHECK_THAT(run.refusal(), Contains("experiment.start_speed_rad_s"));
  run = {};
  run.driver.kind = "usb";
  run.driver.usb.answer_timeout_us = 1000;
  CHECK_THAT(run.refusal(), Contains("driver.usb.answer_timeout_us = 1000") && Contains("1000"));
  run.driver.usb.answer_timeout_us = 999;
  CHECK(run.refusal().empty());
}

TEST_CASE("The gate's duty caps never exceed the board's") {
  for (const char* kind : {"pci", "can", "usb"}) {
    driver::DriverOptions driver{.kind = kind};
    driver.pci.brake_duty_max = driver.can.brake_duty_max = driver.usb.brake_duty_max = 0.7;
    driver.pci.motor_duty_max = driver.can.motor_duty_max = driver.usb.motor_duty_max = 0.9;
    CHECK_NOTHROW(runtime::refuse_caps_above_board({.brake = 0.7, .motor = 0.9}, driver));
    CHECK_THROWS_WITH(runtime::refuse_caps_above_board({.brake = 0.71}, driver),
                      Contains("gate.brake_duty_max = 0.71") && Contains(std::string("driver.") + kind));
    CHECK_THROWS_WITH(runtime::refuse_caps_above_board({.motor = 0.91}, driver), Contains("gate.motor_duty_max"));
    rig::RigParameters rig;
    rig.encoder_counts_per_rev = 1024;
    runtime::GateOptions gate;
    runtime::apply_board_limits(rig, 500.0, gate, driver);
    CHECK(gate.brake_duty_max == 0.7);
    CHECK(gate.motor_duty_max == 0.9);
    CHECK(driver.usb.encoder_counts_per_rev == 1024);
    CHECK(driver.can.rate_Hz == 500.0);
  }
}

TEST_CASE("A board without duty caps is not driven") {
  const driver::DriverOptions driver{.kind = "unheard-of"};
  CHECK_THROWS_WITH(runtime::refuse_caps_above_board({}, driver), Contains("driver.kind = unheard-of"));
}
