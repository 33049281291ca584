// The PCI driver's accesses to the emulated card, one by one.
#include "driver/pci/pci_driver.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "catch.hpp"
#include "model_card.hpp"

using namespace abs_hil;
using namespace abs_hil::driver;
using pci::PciOptions;
using test::ModelCard;
using test::RegisterAccess;

namespace {

constexpr std::int64_t ms = 1'000'000;

std::vector<std::uint32_t> offsets(const std::vector<RegisterAccess>& traffic) {
  std::vector<std::uint32_t> result;
  for (const RegisterAccess& access : traffic) result.push_back(access.offset);
  return result;
}

RegisterAccess W(std::uint32_t offset, std::uint32_t value) { return {true, offset, value}; }
RegisterAccess R(std::uint32_t offset, std::uint32_t value) { return {false, offset, value}; }

}  // namespace

TEST_CASE("Configuring reads and writes nothing") {
  ModelCard card;
  const auto own_driver = pci::pci_driver({}, card.opener());
  driver::RigDriver& driver = *own_driver;
  driver.configure();
  for (const RegisterAccess& access : card.take_traffic()) CHECK_FALSE(access.is_write);
  CHECK(driver.notes().size() == 4);
  static_cast<void>(driver.inspection());
  for (const RegisterAccess& access : card.take_traffic()) CHECK_FALSE(access.is_write);
}

TEST_CASE("Activation takes the outputs over: width 0 first, mode and prescaler verified, counters reset") {
  ModelCard card;
  card.model.write32(0x60, 1);  // as somebody else left it
  card.model.write32(0x6C, 3000);
  card.model.write32(0x84, 7);
  const auto own_driver = pci::pci_driver({}, card.opener());
  driver::RigDriver& driver = *own_driver;
  driver.configure();
  card.take_traffic();
  driver.activate(0);
  const std::vector<RegisterAccess> expected{W(0x60, 0),  W(0x6C, 0),  R(0x6C, 0),  W(0x64, 1),  R(0x64, 1),
                                             W(0x68, 60), R(0x68, 60), W(0x60, 1),  W(0x6C, 0),  R(0x6C, 0),
                                             W(0x64, 1),  R(0x64, 1),  W(0x68, 60), R(0x68, 60), W(0x84, 3),
                                             W(0x84, 0),  W(0x80, 1),  R(0x88, 0),  W(0x80, 0),  R(0x88, 0)};
  const std::vector<RegisterAccess> traffic = card.take_traffic();
  REQUIRE(traffic.size() == expected.size() + pci::health_registers.size() + 2 * pci::settings.size());
  CHECK(std::equal(expected.begin(), expected.end(), traffic.begin()));
  CHECK(card.model.outputs().brake_duty == 0.0);
}

TEST_CASE("A cycle has exactly twelve accesses, with the health registers and the settings in turn") {
  ModelCard card;
  const auto own_driver = pci::pci_driver({}, card.opener());
  driver::RigDriver& driver = *own_driver;
  driver.configure();
  driver.activate(0);
  card.take_traffic();
  rig::Measurement measurement;
  for (std::size_t cycle = 0; cycle < 40; ++cycle) {
    REQUIRE(driver.read(static_cast<std::int64_t>(cycle) * ms, measurement).ok());
    REQUIRE(driver.write({.brake_duty = 0.5, .brake_torque_Nm = 1.4}).ok());
    const std::vector<RegisterAccess> traffic = card.take_traffic();
    CHECK(traffic.size() == pci::accesses_per_cycle);
    std::vector<std::uint32_t> expected{0x80, 0x88, 0x80, 0x88, pci::health_registers[cycle % 4], 0x60, 0x6C,
                                        0x6C, 0x60, 0x6C, 0x6C};
    const pci::Setting& setting = pci::settings[cycle % pci::settings.size()];
    expected.insert(setting.pwm == pci::Pwm::brake ? expected.end() : expected.begin() + 8, setting.offset);
    CHECK(offsets(traffic) == expected);
  }
}

TEST_CASE("The brake is capped at 0.7 unless configured, the drive as configured") {
  ModelCard card;
  PciOptions options;
  SECTION("as delivered") {
    const auto own_driver = pci::pci_driver(options, card.opener());
    driver::RigDriver& driver = *own_driver;
    driver.configure();
    driver.activate(0);
    REQUIRE(driver.write({.motor_duty = 1.0, .brake_duty = 1.0, .motor_enable = true}).ok());
    CHECK(card.model.outputs().brake_duty == 2866.0 / 4095.0);
    CHECK(card.model.outputs().drive_duty == 1.0);
  }
  SECTION("configured") {
    options.brake_duty_max = 1.0;
    options.motor_duty_max = 0.25;
    const auto own_driver = pci::pci_driver(options, card.opener());
    driver::RigDriver& driver = *own_driver;
    driver.configure();
    driver.activate(0);
    REQUIRE(driver.write({.motor_duty = 1.0, .brake_duty = 1.0, .motor_enable = true}).ok());
    CHECK(card.model.outputs().brake_duty == 1.0);
    CHECK(card.model.outputs().drive_duty == 1023.0 / 4095.0);
  }
  SECTION("8-bit mode") {
    options.pwm_mode = "8-bit";
    options.pwm_prescaler = 44;
    const auto own_driver = pci::pci_driver(options, card.opener());
    driver::RigDriver& driver = *own_driver;
    driver.configure();
    driver.activate(0);
    REQUIRE(driver.write({.motor_duty = 0.5, .motor_enable = true}).ok());
    CHECK(card.model.outputs().drive_duty == 128.0 / 255.0);
    CHECK(card.model.read32(0x68) == 44);
  }
}

TEST_CASE("Channels and signs of the encoders are those configured") {
  ModelCard card;
  PciOptions options;
  options.lower_channel = 1;
  options.upper_channel = 0;
  options.upper_sign = -1;
  const auto own_driver = pci::pci_driver(options, card.opener());
  driver::RigDriver& driver = *own_driver;
  driver.configure();
  driver.activate(0);
  card.model.turn_by_hand(true, 0.05);    // the model's upper wheel is on channel 1
  card.model.turn_by_hand(false, 0.025);  // its lower wheel on channel 0
  rig::Measurement measurement;
  REQUIRE(driver.read(ms, measurement).ok());
  CHECK(measurement.lower_counts == 204);
  CHECK(measurement.upper_counts == -102);
}

TEST_CASE("Counters wrap around at 32 bit, with either sign") {
  for (const std::int32_t sign : {1, -1}) {
    ModelCard card;
    PciOptions options;
    options.upper_sign = sign;
    const auto own_driver = pci::pci_driver(options, card.opener());
    driver::RigDriver& driver = *own_driver;
    driver.configure();
    driver.activate(0);
    // The register 50 counts before and after the wrap, seen through a register that reads too much.
    rig::Measurement before;
    rig::Measurement after;
    card.faulty.set("88:wrong=2147483598");
    // A jump of 2^31 - 50 counts is no speed a wheel can have: allowed here to get near the wrap.
    CHECK(driver.read(ms, before).error == IoError::implausible_answer);
    REQUIRE(driver.read(2 * ms, before).ok());
    card.model.turn_by_hand(true, 100.0 / 4096.0);
    REQUIRE(driver.read(3 * ms, after).ok());
    CHECK(before.upper_counts == sign * 2147483598);
    const auto travelled = static_cast<std::int32_t>(static_cast<std::uint32_t>(after.upper_counts) -
                                                     static_cast<std::uint32_t>(before.upper_counts));
    CHECK(std::abs(travelled - sign * 100) <= 1);
    CHECK((after.upper_counts < 0) == (sign > 0));
  }
}

TEST_CASE("A reading has the time stamp of its middle; a delayed one is repeated") {
  static std::int64_t clock_ns;
  static std::int64_t step_ns;
  clock_ns = 0;
  step_ns = 40'000;
  const auto clock = []() noexcept { return clock_ns += step_ns; };
  ModelCard card;
  const auto own_driver = pci::pci_driver({}, card.opener(), clock);
  driver::RigDriver& driver = *own_driver;
  driver.configure();
  driver.activate(0);
  card.take_traffic();
  rig::Measurement measurement;
  clock_ns = 10 * ms;
  REQUIRE(driver.read(10 * ms, measurement).ok());
  CHECK(measurement.time_ns == 10 * ms + 40'000 + 20'000);
  CHECK(card.take_traffic().size() == pci::accesses_in_read);
  clock_ns = 20 * ms;
  step_ns = 300'000;
  REQUIRE(driver.read(20 * ms, measurement).ok());
  CHECK(card.take_traffic().size() == pci::accesses_in_read + 4);
  CHECK(measurement.time_ns == 20 * ms + 3 * 300'000 + 150'000);
}

TEST_CASE("Options outside their range are named") {
  ModelCard card;
  PciOptions options;
  options.upper_sign = 0;
  CHECK_THROWS_WITH(pci::pci_driver(options, card.opener()), Catch::Matchers::Contains("driver.pci.upper_sign = 0"));
  options.upper_sign = 1;
  options.upper_channel = options.lower_channel;
  CHECK_THROWS_WITH(pci::pci_driver(options, card.opener()), Catch::Matchers::Contains("driver.pci.lower_channel"));
}
