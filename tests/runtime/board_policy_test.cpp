// What the safety policy allows a run on hardware, and what it says otherwise.
#include "runtime/board_policy.hpp"

#include <filesystem>
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

/// What a run wants of a board, and the policy's answer: empty if it is allowed.
struct Asked {
  driver::DriverOptions driver{};
  bool guarded{true};
  bool virtual_time{false};
  double start_speed_rad_s{0.0};
  std::string inject{};
  double rate_Hz{1000.0};
  double guardian_timeout_ms{20.0};
  std::vector<runtime::WeakValue> weak{};
  int model_counts_per_rev{0};
  runtime::UnsafeOptions unsafe{};
  mutable std::vector<std::string> accepted{};

  [[nodiscard]] std::string refusal() const {
    try {
      accepted = runtime::refuse_unsafe_use({.driver = driver,
                                             .guarded = guarded,
                                             .virtual_time = virtual_time,
                                             .rate_Hz = rate_Hz,
                                             .guardian_timeout_ms = guardian_timeout_ms,
                                             .unsafe = unsafe,
                                             .start_speed_rad_s = start_speed_rad_s,
                                             .injections = driver::parse_injections(inject),
                                             .weak = weak,
                                             .model_counts_per_rev = model_counts_per_rev,
                                             .rig_counts_per_rev = 4096});
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
  CHECK(runtime::is_real_board(board));
  board.emulated = true;  // the kernel's cards are real whatever the configuration says
  CHECK(runtime::is_real_board(board));
  board.emulated = false;
  pci(board).root = "/tmp/emulated/pci";
  CHECK_FALSE(runtime::is_real_board(board));

  board.kind = "can";
  can(board).interface = "unix:/tmp/bus";
  CHECK_FALSE(runtime::is_real_board(board));
  can(board).interface = "an-interface-that-is-not-there";
  CHECK(runtime::is_real_board(board));
  board.emulated = true;
  CHECK_FALSE(runtime::is_real_board(board));
  board.emulated = false;
  if (const std::string adapter = an_adapter(); !adapter.empty()) {
    can(board).interface = adapter;
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
  can(run.driver).interface = an_adapter();
  if (can(run.driver).interface.empty()) {
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
  Asked run{.virtual_time = true};
  CHECK_THAT(run.refusal(), Contains("--fast"));
  run.driver.emulated = true;
  CHECK(run.refusal().empty());
  run = {.start_speed_rad_s = 170.0};
  CHECK_THAT(run.refusal(), Contains("experiment.start_speed_rad_s"));
  run = {};
  run.driver.kind = "usb";
  usb(run.driver).answer_timeout_us = 1000;
  CHECK_THAT(run.refusal(), Contains("driver.usb.answer_timeout_us = 1000") && Contains("1000"));
  usb(run.driver).answer_timeout_us = 999;
  CHECK(run.refusal().empty());
}

TEST_CASE("The gate's duty caps never exceed the board's") {
  for (const char* kind : {"pci", "can", "usb"}) {
    driver::DriverOptions driver{.kind = kind};
    pci(driver).brake_duty_max = can(driver).brake_duty_max = usb(driver).brake_duty_max = 0.7;
    pci(driver).motor_duty_max = can(driver).motor_duty_max = usb(driver).motor_duty_max = 0.9;
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
    CHECK(driver.encoder_counts_per_rev == 1024);
    CHECK(driver.rate_Hz == 500.0);
  }
}

TEST_CASE("A board without duty caps is not driven") {
  const driver::DriverOptions driver{.kind = "unheard-of"};
  CHECK_THROWS_WITH(runtime::refuse_caps_above_board({}, driver), Contains("driver.kind = unheard-of"));
}

TEST_CASE("A guardian that would end a healthy run is refused on every board") {
  Asked run{.rate_Hz = 100.0, .guardian_timeout_ms = 19.9};
  pci(run.driver).root = "/tmp";
  CHECK_THAT(run.refusal(), Contains("guardian.timeout_ms = 19.9") && Contains("two periods, 20 ms"));
  run.guardian_timeout_ms = 20.0;
  CHECK(run.refusal().empty());
  run.guardian_timeout_ms = 2.0;
  run.virtual_time = true;  // has no guardian
  run.driver.emulated = true;
  CHECK(run.refusal().empty());
}

TEST_CASE("A weak value on hardware needs a person's consent, and is told; an emulator takes it") {
  const runtime::WeakValue insist{.key = "guardian.insist_s",
                                  .value = "0.001",
                                  .class_text = "weakens unless 0 s",
                                  .meaning = "how long the guardian tries"};
  Asked run{.weak = {insist}};
  CHECK_THAT(run.refusal(), Contains("guardian.insist_s = 0.001") && Contains("weakens unless 0 s") &&
                                Contains("--set unsafe.keys=guardian.insist_s"));
  run.unsafe.blind_control = true;  // another consent
  CHECK_FALSE(run.refusal().empty());
  run.unsafe = {.keys = "gate.overspeed_rad_s,guardian.insist_s"};
  CHECK(run.refusal().empty());
  CHECK(run.accepted.size() == 1);
  CHECK_THAT(run.accepted.at(0), Contains("guardian.insist_s = 0.001 weakens the protection"));
  run.unsafe.keys = "guardian.insist_s_and_more,guardian.insist";
  CHECK_FALSE(run.refusal().empty());
  run.unsafe.keys = "";
  pci(run.driver).root = "/tmp";
  CHECK(run.refusal().empty());
  CHECK(run.accepted.empty());
}

TEST_CASE("A weak value may have a flag of its own that consents") {
  const auto weak = [](const char* key, const char* consent) {
    return Asked{.weak = {runtime::WeakValue{.key = key, .value = "1", .class_text = "c", .consent = consent}}};
  };
  Asked slow = weak("guardian.timeout_ms", "outputs_on_after_death");
  CHECK_THAT(slow.refusal(), Contains("guardian.timeout_ms = 1") && Contains("unsafe.outputs_on_after_death=true"));
  slow.unsafe.outputs_on_after_death = true;
  CHECK(slow.refusal().empty());
  slow.unsafe = {.blind_control = true};
  CHECK_FALSE(slow.refusal().empty());
  Asked blind = weak("gate.sample_age_max_s", "blind_control");
  CHECK_FALSE(blind.refusal().empty());
  blind.unsafe.blind_control = true;
  CHECK(blind.refusal().empty());
}

TEST_CASE("The encoders' scale is the rig's, also on an emulated board") {
  Asked run{.model_counts_per_rev = 2048};
  pci(run.driver).root = "/tmp";
  CHECK_THAT(run.refusal(), Contains("model.encoder_counts_per_rev = 2048") && Contains("give 4096 counts"));
  run.model_counts_per_rev = 4096;
  CHECK(run.refusal().empty());
}

TEST_CASE("A CAN node that would hold its outputs for long needs a person's consent") {
  Asked node{};
  node.driver.kind = "can";
  can(node.driver).interface = "can0";  // not there: taken for hardware
  can(node.driver).watchdog_ms = 51;
  CHECK_THAT(node.refusal(), Contains("driver.can.watchdog_ms = 51") && Contains("unsafe.outputs_on_after_death=true"));
  node.unsafe.outputs_on_after_death = true;
  CHECK(node.refusal().empty());
  node = {};
  node.driver.kind = "can";
  can(node.driver).interface = "unix:/tmp/bus";
  can(node.driver).watchdog_ms = 10'000;
  CHECK(node.refusal().empty());
}
