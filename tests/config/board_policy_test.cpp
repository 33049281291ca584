// What the safety policy allows a run on hardware, and what it says otherwise.
#include "config/board_policy.hpp"

#include <filesystem>
#include <fstream>
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
      accepted = config::refuse_unsafe_use(s, keys, virtual_time);
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

TEST_CASE("A real board is not driven without a guardian, and gets no faults; one that has shown the mark does") {
  Asked unguarded{"guardian.enabled=false"};
  CHECK_THAT(unguarded.refusal(), Contains("guardian.enabled = false") && Contains("emulator's mark"));
  unguarded.driver.emulated = true;
  CHECK(unguarded.refusal().empty());
  Asked faulty{"run.inject=brake@encoder_upper:stuck"};
  CHECK_THAT(faulty.refusal(), Contains("--inject") && Contains("never injected into real hardware"));
  faulty.driver.emulated = true;
  CHECK(faulty.refusal().empty());
}

TEST_CASE("No key, no folder, no interface and no address make an emulator of a board") {
  const std::filesystem::path folder = std::filesystem::temp_directory_path() / "abs_hil_unmarked_card";
  const std::filesystem::path card = folder / "0000:03:00.0";
  std::filesystem::create_directories(card);
  const auto put = [&card](const char* name, const std::string& text) { std::ofstream(card / name) << text; };
  put("vendor", "0x10b5\n");
  put("device", "0x2497\n");
  put("enable", "1\n");
  const std::string none = "0x0000000000000000 0x0000000000000000 0x0000000000000000\n";
  put("resource", none + none + "0x000000000000e000 0x000000000000e0ff 0x0000000000040101\n");
  put("resource2", std::string(256, '\0'));
  driver::DriverOptions board;
  board.kind = "pci";
  pci(board).root = folder;
  config::learn_reality(board);
  CHECK(config::is_real_board(board));
  board.emulated = true;  // demanded
  CHECK_THROWS_WITH(config::learn_reality(board), Contains("driver.emulated = true demands an emulator") &&
                                                      Contains("driver.pci.root = " + folder.string()));
  put("resource2", "ABS-EMUL" + std::string(248, '\0'));
  config::learn_reality(board);
  CHECK_FALSE(config::is_real_board(board));
  std::filesystem::remove_all(folder);

  pci(board).root = "/sys/bus/pci/devices";  // the kernel's cards, whoever calls them what
  CHECK_THROWS_WITH(config::learn_reality(board), Contains("holds the real cards"));

  usb(board).sysfs_root = std::filesystem::temp_directory_path();
  std::filesystem::create_directories(folder / "1-1");
  std::ofstream(folder / "1-1/idVendor") << "1209\n";
  std::ofstream(folder / "1-1/idProduct") << "0001\n";
  std::ofstream(folder / "1-1/manufacturer") << "InTeCo\n";
  std::ofstream(folder / "1-1/product") << "RT-DAC/USB2 emulator\n";
  board.kind = "usb";
  usb(board).sysfs_root = folder;  // files that somebody has written, not the kernel's
  CHECK_THROWS_WITH(config::learn_reality(board), Contains("driver.usb.sysfs_root"));
  std::filesystem::remove_all(folder);

  if (const std::string adapter = an_adapter(); !adapter.empty()) {
    board.kind = "can";
    can(board).interface = adapter;
    CHECK_THROWS_WITH(config::learn_reality(board), Contains("is an adapter to a real bus"));
  }
}

TEST_CASE("A silent board is real, unless somebody demands an emulator: its driver then refuses one without the mark") {
  driver::DriverOptions board;
  board.kind = "can";
  can(board).interface = "unix:/tmp/abs_hil_no_such_bus";
  for (const bool demanded : {false, true}) {
    board.emulated = demanded;
    config::learn_reality(board);
    CHECK(config::is_real_board(board) != demanded);
  }
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
  CHECK_THAT(run.accepted.at(0), Contains("guardian.insist_s = 0.001 weakens the protection"));
  run.s.unsafe.keys = "";
  run.driver.emulated = true;
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
  run.driver.emulated = true;
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
  emulated.driver.emulated = true;
  can(emulated.driver).watchdog_ms = 10'000;
  CHECK(emulated.refusal().empty());
}
