// The doctor's search for PCI cards, in a made-up tree of devices.
#include "catch.hpp"
#include "diagnosis/fake_system.hpp"
#include "driver/pci/wire.hpp"

using namespace abs_hil::driver;
using namespace abs_hil::driver::pci;
using abs_hil::diagnosis::test::FakeSystem;
using Catch::Matchers::Contains;

namespace {
const std::string devices = "sys/bus/pci/devices/";

void put_card(FakeSystem& system, const std::string& address, std::string_view enabled) {
  system.put(devices + address + "/vendor", "0x10b5")
      .put(devices + address + "/device", "0x2497")
      .put(devices + address + "/enable", enabled)
      .put(devices + address + "/resource", "0 0 0\n0 0 0\n0xe000 0xe0ff 0x40101")
      .put(devices + address + "/resource2", std::string(256, ' '));
}

PciOptions options_of(const FakeSystem& system) { return {.root = (system.root() / devices).string()}; }
}  // namespace

TEST_CASE("Cards are found by vendor and device among others, with binding and access") {
  FakeSystem system;
  put_card(system, "0000:03:00.0", "1");
  put_card(system, "0000:04:00.0", "0");
  system.link(devices + "0000:04:00.0/driver", "../../../../bus/pci/drivers/uio_pci_generic");
  system.put(devices + "0000:00:01.0/vendor", "0x8086").put(devices + "0000:00:01.0/device", "0x2497");
  const auto boards = survey_cards(options_of(system));
  REQUIRE(boards.size() == 2);
  CHECK(boards[0].what == "RT-DAC4/PCI at 0000:03:00.0");
  CHECK(boards[0].selection == std::vector<std::string>{"driver.pci.bdf=0000:03:00.0"});
  CHECK(boards[0].obstacles.empty());
  REQUIRE(boards[1].obstacles.size() == 2);
  CHECK_THAT(boards[1].obstacles[0].fix, Contains("/sys/bus/pci/devices/0000:04:00.0/enable"));
  CHECK_THAT(boards[1].obstacles[1].what, Contains("uio_pci_generic"));
  CHECK_THAT(boards[1].obstacles[1].fix, Contains("/sys/bus/pci/devices/0000:04:00.0/driver/unbind"));
}

TEST_CASE("Options that name one card leave out the others") {
  FakeSystem system;
  put_card(system, "0000:03:00.0", "1");
  put_card(system, "0000:04:00.0", "1");
  PciOptions options = options_of(system);
  options.bdf = "0000:04:00.0";
  REQUIRE(survey_cards(options).size() == 1);
  CHECK(survey_cards(options).front().what == "RT-DAC4/PCI at 0000:04:00.0");
}

TEST_CASE("Registers that cannot be opened are reported with the fix") {
  FakeSystem system;
  put_card(system, "0000:03:00.0", "1");
  std::filesystem::remove(system.root() / (devices + "0000:03:00.0/resource2"));
  const auto boards = survey_cards(options_of(system));
  REQUIRE(boards.front().obstacles.size() == 1);
  CHECK_THAT(boards.front().obstacles.front().fix, Contains("chmod g+rw"));
}

TEST_CASE("A card that answers all ones is not on the bus") {
  FakeSystem system;
  put_card(system, "0000:03:00.0", "1");
  system.put(devices + "0000:03:00.0/resource2", std::string(256, '\xff'));
  const auto boards = survey_cards(options_of(system));
  REQUIRE(boards.front().obstacles.size() == 1);
  CHECK_THAT(boards.front().obstacles.front().what, Contains("answers all ones"));
}

TEST_CASE("No folder of devices is no card") {
  FakeSystem system;
  CHECK(survey_cards(options_of(system)).empty());
}

TEST_CASE("A card without an address, and a table that is none, are obstacles and no errors") {
  FakeSystem system;
  put_card(system, "0000:03:00.0", "1");
  system.put(devices + "0000:03:00.0/resource", "0 0 0\n0 0 0\n0x0 0xff 0x20040101");
  const auto unset = survey_cards(options_of(system)).front().obstacles;
  REQUIRE(unset.size() == 1);
  CHECK_THAT(unset.front().what, Contains("not assigned"));
  system.put(devices + "0000:03:00.0/resource", "nonsense");
  CHECK_THAT(survey_cards(options_of(system)).front().obstacles.front().what, Contains("cannot be read as far"));
}
