// Faults of the card or a part of it: the driver's error, and the outputs afterwards.

#include <algorithm>
#include <string>

#include "catch.hpp"
#include "driver/pci/pci_driver.hpp"
#include "model_card.hpp"

using namespace abs_hil;
using namespace abs_hil::driver;
using Catch::Matchers::Contains;
using test::ModelCard;

namespace {

constexpr std::int64_t ms = 1'000'000;
constexpr rig::Command drive{.motor_duty = 0.5, .motor_enable = true};

std::string configure_refusal(RigDriver& driver) {
  try {
    driver.configure();
  } catch (const Unavailable& error) {
    return error.what();
  }
  return "configured";
}

struct Running {
  explicit Running(const emulator::BoardOptions& options = {})
      : card(options), own(pci::pci_driver({}, card.opener())), driver(*own) {
    driver.configure();
    driver.activate(0);
    REQUIRE(driver.read(0, measurement).ok());
    REQUIRE(driver.write(drive).ok());
    REQUIRE(card.model.outputs().drive_duty > 0.4);
  }
  IoResult read_after(std::int64_t now_ns) { return driver.read(now_ns, measurement); }

  ModelCard card;
  std::unique_ptr<RigDriver> own;
  RigDriver& driver;
  rig::Measurement measurement{};
};

}  // namespace

TEST_CASE("All ones and another bitstream are refused before anything is written") {
  ModelCard card;
  pci::PciOptions options;
  options.bitstream = 0xAB5;
  const auto own_driver = pci::pci_driver(options, card.opener());
  driver::RigDriver& driver = *own_driver;
  CHECK(configure_refusal(driver) == "configured");
  card.faulty.answer_all_ones(true);
  CHECK_THAT(configure_refusal(driver), Contains("answers all ones") && Contains("nothing was written"));
  CHECK(driver.state() == DriverState::unconfigured);
  card.faulty.answer_all_ones(false);
  options.bitstream = 0xAB6;
  const auto own_other = pci::pci_driver(options, card.opener());
  driver::RigDriver& other = *own_other;
  CHECK_THAT(configure_refusal(other), Contains("bitstream version 2741 is not the configured 2742"));
  for (const auto& access : card.traffic) CHECK_FALSE(access.is_write);
}

TEST_CASE("A card that leaves the bus while running is gone, whichever access notices") {
  Running run;
  SECTION("all ones, found reading") {
    run.card.faulty.answer_all_ones(true);
    CHECK(run.read_after(ms).error == IoError::disconnected);
  }
  SECTION("all ones, found writing") {
    run.card.faulty.answer_all_ones(true);
    CHECK(run.driver.write(drive).error == IoError::disconnected);
    CHECK(run.driver.state() == DriverState::failed);
  }
  SECTION("unplugged") {
    run.card.unplugged = true;
    const IoResult result = run.read_after(ms);
    CHECK(result.error == IoError::disconnected);
    CHECK(result.errno_value == ENODEV);
    CHECK(run.driver.write(drive).error == IoError::disconnected);
  }
  CHECK(run.driver.deactivate().error == IoError::disconnected);  // the safe state is not known to have arrived
}

TEST_CASE("A count of -1 is no missing card") {
  Running run;
  run.card.model.turn_by_hand(true, -0.5 / 4096.0);
  REQUIRE(run.driver.write(rig::safe_command).ok());
  REQUIRE(run.read_after(1).ok());
  CHECK(run.measurement.upper_counts == -1);
}

TEST_CASE("A PWM register that does not hold what was written is found; the other output is made safe") {
  const std::string fault = GENERATE("6c:stuck", "6c:wrong=1", "6c:garbage");
  Running run;
  run.card.faulty.set(fault);
  const IoResult result = run.driver.write({.brake_duty = 0.6});
  CHECK(result.error == IoError::read_back_mismatch);
  CHECK(result.where == 0x6C);
  CHECK(run.driver.state() == DriverState::failed);
  run.card.faulty.set("6c:ok");
  CHECK(run.driver.deactivate().ok());
  CHECK(run.card.model.outputs().drive_duty == 0.0);
  CHECK(run.card.model.outputs().brake_duty == 0.0);
}

TEST_CASE("A register that does not answer is an error at its place") {
  Running run;
  run.card.faulty.set("88:off");
  const IoResult result = run.read_after(ms);
  CHECK_FALSE(result.ok());
  CHECK(result.where == 0x88);
  CHECK(run.driver.state() == DriverState::active);  // a failed read leaves the outputs to the caller's next write
  CHECK(run.driver.write(rig::safe_command).ok());
  CHECK(run.card.model.outputs().drive_duty == 0.0);
}

TEST_CASE("A random counter is refused") {
  Running run;
  run.card.faulty.set("88:wrong=100000");
  CHECK(run.read_after(ms).error == IoError::implausible_answer);
}

TEST_CASE("Taking over fails, with the register, if mode or counter do not take their value") {
  const auto [fault, words] =
      GENERATE(std::pair("64:wrong=1", "0x64"), std::pair("88:wrong=1000000", "0x84"), std::pair("6c:off", "0x6c"));
  ModelCard card;
  const auto own_driver = pci::pci_driver({}, card.opener());
  driver::RigDriver& driver = *own_driver;
  driver.configure();
  card.faulty.set(fault);
  CHECK_THROWS_WITH(driver.activate(0), Contains("taking over the outputs failed") && Contains(words));
  CHECK(driver.state() == DriverState::inactive);
  CHECK(card.model.outputs().drive_duty == 0.0);
}

TEST_CASE("A trip of the FPGA is reported as such, whether or not it clears the width registers") {
  const bool clears = GENERATE(false, true);
  const std::uint32_t bit = GENERATE(0U, 2U);
  Running run({.start_speed_rad_s = 100.0, .overspeed_bit = bit, .trip_clears_width = clears});
  run.card.model.trip_overspeed();
  CHECK(run.card.model.outputs().drive_duty == 0.0);
  REQUIRE(run.driver.write(drive).ok());
  bool seen = false;
  for (std::int64_t cycle = 1; cycle <= 4; ++cycle) {
    REQUIRE(run.read_after(cycle * ms).ok());
    seen = seen || run.measurement.trip_flags == 1U << bit;
  }
  CHECK(seen);  // within four cycles: the health registers take turns
}

TEST_CASE("Supply and temperature reach the measurement within four cycles") {
  Running run;
  run.card.model.set_supply_V(10.0);
  run.card.model.set_temperature_C(95.0);
  for (std::int64_t cycle = 1; cycle <= 4; ++cycle) REQUIRE(run.read_after(cycle * ms).ok());
  CHECK_THAT(run.measurement.supply_V, Catch::Matchers::WithinAbs(10.0, 0.01));
  CHECK_THAT(run.measurement.temperature_C, Catch::Matchers::WithinAbs(95.0, 0.1));
  CHECK((run.measurement.trip_flags & rig::trip::supply) != 0);
  CHECK((run.measurement.trip_flags & rig::trip::temperature_or_overspeed) != 0);
}

TEST_CASE("A mode that something else changes is found within five cycles, any other setting within twenty") {
  // Offset, PWM, new value, most cycles. In 8-bit mode the drive's width would be duty 1.
  struct Change {
    std::uint32_t offset, pwm, value;
    int cycles;
  };
  const auto change =
      GENERATE(Change{0x64, 0, 0, 5}, Change{0x64, 1, 0, 5}, Change{0x68, 0, 0, 20}, Change{0x68, 1, 0, 20},
               Change{0x50, 0, 1, 20}, Change{0x5C, 0, 0xFFFF, 20}, Change{0xA4, 0, 0, 20}, Change{0xA8, 0, 255, 20});
  CAPTURE(change.offset, change.pwm);
  Running run;
  for (int cycle = 1; cycle <= 7; ++cycle) REQUIRE(run.driver.write(drive).ok());
  run.card.model.write32(0x60, change.pwm);
  run.card.model.write32(change.offset, change.value);
  IoResult result{};
  int cycles = 0;
  for (; result.ok() && cycles < 40; ++cycles) result = run.driver.write(drive);
  CHECK(cycles <= change.cycles);
  CHECK(result.error == IoError::foreign_writer);
  CHECK(result.where == change.offset);
  CHECK(result.reason == rig::Reason::board_reconfigured);
  CHECK(run.card.model.outputs().drive_duty == 0.0);
}

TEST_CASE("Logic that is loaded again in mid-run is found within twenty cycles") {
  Running run;
  REQUIRE(run.driver.write(rig::safe_command).ok());
  REQUIRE(run.driver.write(drive).ok());
  run.card.faulty.set("0:wrong=1");  // another version
  SECTION("while outputs are 0, by its version") {
    REQUIRE(run.driver.write(rig::safe_command).ok());
    IoResult result{};
    int cycles = 0;
    for (; result.ok() && cycles < 40; ++cycles) result = run.driver.write(rig::safe_command);
    CHECK(cycles <= 20);
    CHECK(result.reason == rig::Reason::board_reconfigured);
    CHECK(result.where == 0x00);
  }
  SECTION("while an output is on, at once, by its width") {
    run.card.model.write32(0x60, 0);
    run.card.model.write32(0x6C, 0);
    CHECK(run.driver.write(drive).reason == rig::Reason::board_reconfigured);
  }
}

TEST_CASE("One misread setting is no change, and a trip that clears the widths is no other writer") {
  Running run({.start_speed_rad_s = 100.0, .trip_clears_width = true});
  for (std::size_t cycle = 1; cycle <= pci::settings.size(); ++cycle) {  // one was compared in the first write
    const std::uint32_t offset = pci::settings[cycle % pci::settings.size()].offset;
    run.card.misread_next = offset;
    run.card.take_traffic();
    REQUIRE(run.driver.write(drive).ok());
    CHECK(std::ranges::count(run.card.traffic, offset, &test::RegisterAccess::offset) == 2);  // wrong, then right
  }
  run.card.model.trip_overspeed();
  for (int cycle = 0; cycle < 40; ++cycle) REQUIRE(run.driver.write(drive).ok());
}

TEST_CASE("The cause of a wrong width is the other writer even if that one writes at every access") {
  Running run;
  run.card.after_access = [&card = run.card, n = 0]() mutable {
    if (++n % 5 == 0) {
      card.model.write32(0x60, 0);
      card.model.write32(0x6C, 4095);
    }
  };
  IoResult result{};
  for (int cycle = 0; cycle < 5 && result.ok(); ++cycle) result = run.driver.write(drive);
  CHECK(result.reason == rig::Reason::foreign_writer);
  run.card.after_access = nullptr;
  CHECK(run.driver.deactivate().ok());
  CHECK(run.card.model.outputs().drive_duty == 0.0);
}
