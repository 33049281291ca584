// What the safety policy allows a run on hardware, and what it says otherwise.
#include "config/board_policy.hpp"

#include <filesystem>
#include <initializer_list>
#include <stdexcept>
#include <string>

#include "catch.hpp"
#include "driver/board_options.hpp"

using namespace abs_hil;
using Catch::Matchers::Contains;

namespace {

driver::pci::PciOptions& pci(driver::DriverOptions& driver) { return driver.boards.of<driver::pci::PciOptions>(); }
driver::can::CanOptions& can(driver::DriverOptions& driver) { return driver.boards.of<driver::can::CanOptions>(); }
driver::usb::UsbOptions& usb(driver::DriverOptions& driver) { return driver.boards.of<driver::usb::UsbOptions>(); }

/// The settings of a run on a board, and the policy's answer: empty if it is allowed.
struct Asked {
  explicit Asked(std::initializer_list<const char*> assignments = {}) {
    s.backend = "rig";
    keys.leave_out_plant();
    for (const char* assignment : assignments) keys.set_text(assignment, "test");
  }

  [[nodiscard]] std::string refusal() {
    try {
      accepted = config::refuse_unsafe_use(s, config::safety_view(s, keys, {}), virtual_time);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return {};
  }

  config::Settings s{};
  config::KeyTable keys{s};
  driver::DriverOptions& driver{s.driver};
  bool virtual_time{false};
  std::vector<std::string> accepted{};
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
  Asked run{"guardian.enabled=false"};
  CHECK_THAT(run.refusal(), Contains("--set driver.emulated=true"));
  run.driver.emulated = true;
  run.driver.kind = "pci";
  pci(run.driver).root = "/sys/bus/pci/devices";
  CHECK_THAT(run.refusal(), Contains("driver.pci.root = /sys/bus/pci/devices is real hardware"));
  pci(run.driver).root = "/tmp";
  CHECK(run.refusal().empty());
  run.driver.kind = "can";
  can(run.driver).interface = "unix:/tmp/bus";
  CHECK(run.refusal().empty());
}

TEST_CASE("A board is real unless its files, its interface or the configuration say that it is an emulator") {
  driver::DriverOptions board;
  board.kind = "pci";
  pci(board).root = "/sys/bus/pci/devices";
  CHECK(config::is_real_board(board));
  board.emulated = true;  // the kernel's cards are real whatever the configuration says
  CHECK(config::is_real_board(board));
  board.emulated = false;
  pci(board).root = "/tmp/emulated/pci";
  CHECK_FALSE(config::is_real_board(board));

  board.kind = "can";
  can(board).interface = "unix:/tmp/bus";
  CHECK_FALSE(config::is_real_board(board));
  can(board).interface = "an-interface-that-is-not-there";
  CHECK(config::is_real_board(board));
  board.emulated = true;
  CHECK_FALSE(config::is_real_board(board));
  board.emulated = false;
  if (const std::string adapter = an_adapter(); !adapter.empty()) {
    can(board).interface = adapter;
    CHECK(config::is_real_board(board));
  }

  board.kind = "usb";
  CHECK(config::is_real_board(board));
  board.emulated = true;
  CHECK_FALSE(config::is_real_board(board));
}

TEST_CASE("An adapter to a real bus is hardware") {
  Asked run{"guardian.enabled=false"};
  run.driver.emulated = true;
  run.driver.kind = "can";
  can(run.driver).interface = an_adapter();
  if (can(run.driver).interface.empty()) {
    WARN("this computer has no network adapter to try it with");
    return;
  }
  CHECK_THAT(run.refusal(), Contains("driver.can.interface = ") && Contains("is real hardware"));
  run.s.guardian.enabled = true;
  CHECK(run.refusal().empty());
}

TEST_CASE("Faults are injected into emulators alone") {
  Asked run{"run.inject=brake@encoder_upper:stuck"};
  CHECK_THAT(run.refusal(), Contains("--inject") && Contains("never injected into real hardware"));
  run.driver.emulated = true;
  run.driver.kind = "pci";
  pci(run.driver).root = "/sys/bus/pci/devices";
  CHECK_THAT(run.refusal(), Contains("driver.pci.root = /sys/bus/pci/devices holds the real cards"));
  pci(run.driver).root = "/tmp";
  CHECK(run.refusal().empty());
  run.driver.kind = "can";
  can(run.driver).interface = "unix:/tmp/bus";
  CHECK(run.refusal().empty());
  can(run.driver).interface = an_adapter();
  if (can(run.driver).interface.empty()) {
    WARN("this computer has no network adapter to try it with");
    return;
  }
  CHECK_THAT(run.refusal(), Contains("is an adapter to a real bus; give a vcan interface"));
}

TEST_CASE("Hardware runs in real time, from standstill, and waits no longer than a period") {
  Asked run;
  run.virtual_time = true;
  CHECK_THAT(run.refusal(), Contains("--fast"));
  run.driver.emulated = true;
  CHECK(run.refusal().empty());
  CHECK_THAT(Asked{"experiment.start_speed_rad_s=170"}.refusal(), Contains("experiment.start_speed_rad_s"));
  Asked slow{"driver.kind=usb", "driver.usb.answer_timeout_us=1000"};
  CHECK_THAT(slow.refusal(), Contains("driver.usb.answer_timeout_us = 1000") && Contains("1000"));
  usb(slow.driver).answer_timeout_us = 999;
  CHECK(slow.refusal().empty());
}

TEST_CASE("The gate's duty caps never exceed the board's") {
  for (const std::string kind : {"pci", "can", "usb"}) {
    const auto board = [&kind](Asked& run) {
      run.driver.kind = kind;
      pci(run.driver).brake_duty_max = can(run.driver).brake_duty_max = usb(run.driver).brake_duty_max = 0.7;
      pci(run.driver).motor_duty_max = can(run.driver).motor_duty_max = usb(run.driver).motor_duty_max = 0.9;
    };
    Asked brake{"gate.brake_duty_max=0.71"};
    board(brake);
    CHECK_THROWS_WITH(config::apply_board_limits(brake.s, brake.keys),
                      Contains("gate.brake_duty_max = 0.71") && Contains("driver." + kind));
    Asked motor{"gate.motor_duty_max=0.91"};
    board(motor);
    CHECK_THROWS_WITH(config::apply_board_limits(motor.s, motor.keys), Contains("gate.motor_duty_max"));
    Asked both{"gate.brake_duty_max=0.7", "gate.motor_duty_max=0.9"};
    board(both);
    CHECK_NOTHROW(config::apply_board_limits(both.s, both.keys));
    Asked run{"rig.encoder_counts_per_rev=1024", "control.rate_Hz=500"};
    board(run);
    config::apply_board_limits(run.s, run.keys);
    CHECK(run.s.gate.brake_duty_max == 0.7);
    CHECK(run.s.gate.motor_duty_max == 0.9);
    CHECK(run.driver.encoder_counts_per_rev == 1024);
    CHECK(run.driver.rate_Hz == 500.0);
  }
}

TEST_CASE("A board without duty caps is not driven") {
  Asked run;
  run.driver.kind = "unheard-of";
  CHECK_THROWS_WITH(config::apply_board_limits(run.s, run.keys), Contains("driver.kind = unheard-of"));
}

TEST_CASE("A guardian that would end a healthy run is refused on every board") {
  Asked run{"control.rate_Hz=100", "guardian.timeout_ms=19.9"};
  pci(run.driver).root = "/tmp";
  CHECK_THAT(run.refusal(), Contains("guardian.timeout_ms = 19.9") && Contains("two periods, 20 ms"));
  run.s.guardian.timeout_ms = 20.0;
  CHECK(run.refusal().empty());
  run.s.guardian.timeout_ms = 2.0;
  run.virtual_time = true;  // has no guardian
  run.driver.emulated = true;
  CHECK(run.refusal().empty());
}

TEST_CASE("A weak value on hardware needs a person's consent, and is told; an emulator takes it") {
  Asked run{"guardian.insist_s=0.001"};
  CHECK_THAT(run.refusal(), Contains("guardian.insist_s = 0.001") && Contains("weakens unless 0 s") &&
                                Contains("--set unsafe.keys=guardian.insist_s"));
  run.s.unsafe.blind_control = true;  // another consent
  CHECK_FALSE(run.refusal().empty());
  run.s.unsafe = {.keys = "gate.overspeed_rad_s,guardian.insist_s"};
  CHECK(run.refusal().empty());
  CHECK(run.accepted.size() == 1);
  CHECK_THAT(run.accepted.at(0), Contains("guardian.insist_s = 0.001 s weakens the protection"));
  run.s.unsafe.keys = "";
  pci(run.driver).root = "/tmp";
  CHECK(run.refusal().empty());
  CHECK(run.accepted.empty());
}

TEST_CASE("A key in the list consents to its own value alone") {
  Asked run{"gate.overspeed_rad_s=251"};
  for (const char* keys : {"gate.overspeed_rad_s", "gate.overspeed_rad_s,a", "a,gate.overspeed_rad_s",
                           "a,gate.overspeed_rad_s,b", ",gate.overspeed_rad_s"}) {
    run.s.unsafe.keys = keys;
    CHECK(run.refusal().empty());
  }
  for (const char* keys : {"", ",", "a", "gate", "gate.overspeed_rad_s2", "xgate.overspeed_rad_s",
                           "gate.overspeed_rad_", "gate.overspeed_rad_s a", "a, gate.overspeed_rad_s"}) {
    run.s.unsafe.keys = keys;
    CHECK_FALSE(run.refusal().empty());
  }
}

TEST_CASE("A weak value may have a flag of its own that consents") {
  Asked slow{"guardian.timeout_ms=41"};
  CHECK_THAT(slow.refusal(), Contains("guardian.timeout_ms = 41") && Contains("unsafe.outputs_on_after_death=true"));
  slow.s.unsafe.outputs_on_after_death = true;
  CHECK(slow.refusal().empty());
  slow.s.unsafe = {.outputs_on_after_death = true, .blind_control = true, .foreign_controller = true};
  CHECK(slow.refusal().empty());
  slow.s.unsafe = {.blind_control = true, .foreign_controller = true};
  CHECK_FALSE(slow.refusal().empty());
  Asked blind{"gate.sample_age_max_s=0.051"};
  CHECK_FALSE(blind.refusal().empty());
  blind.s.unsafe.blind_control = true;
  CHECK(blind.refusal().empty());
  Asked without{"gate.overspeed_rad_s=251"};
  without.s.unsafe = {.outputs_on_after_death = true, .blind_control = true, .foreign_controller = true};
  CHECK_FALSE(without.refusal().empty());
}

TEST_CASE("The encoders' scale is the rig's, also on an emulated board") {
  Asked run{"model.encoder_counts_per_rev=2048"};
  pci(run.driver).root = "/tmp";
  CHECK_THAT(run.refusal(), Contains("model.encoder_counts_per_rev = 2048") && Contains("give 4096 counts"));
  run.s.model.encoder_counts_per_rev = 4096;
  CHECK(run.refusal().empty());
}

TEST_CASE("A CAN node that would hold its outputs for long needs a person's consent") {
  Asked node{"driver.kind=can"};
  can(node.driver).interface = "can0";  // not there: taken for hardware
  can(node.driver).watchdog_ms = 51;
  CHECK_THAT(node.refusal(), Contains("driver.can.watchdog_ms = 51") && Contains("unsafe.outputs_on_after_death=true"));
  node.s.unsafe.outputs_on_after_death = true;
  CHECK(node.refusal().empty());
  Asked emulated{"driver.kind=can"};
  can(emulated.driver).interface = "unix:/tmp/bus";
  can(emulated.driver).watchdog_ms = 10'000;
  CHECK(emulated.refusal().empty());
}
