#include "diagnosis/board_scan.hpp"

#include "catch.hpp"
#include "fake_system.hpp"

using namespace abs_hil::diagnosis;
using namespace abs_hil::diagnosis::test;

namespace {
const std::string devices = "sys/bus/pci/devices/";

void put_card(FakeSystem& system, const std::string& address, std::string_view enabled) {
  system.put(devices + address + "/vendor", "0x10b5")
      .put(devices + address + "/device", "0x2497")
      .put(devices + address + "/enable", enabled)
      .put(devices + address + "/resource2", "");
}
}  // namespace

TEST_CASE("cards are found by vendor and device among others, with binding and access") {
  FakeSystem system;
  put_card(system, "0000:03:00.0", "1");
  put_card(system, "0000:04:00.0", "0");
  system.link(devices + "0000:04:00.0/driver", "../../../../bus/pci/drivers/uio_pci_generic");
  system.put(devices + "0000:00:01.0/vendor", "0x8086").put(devices + "0000:00:01.0/device", "0x2497");
  const auto boards = find_pci_boards(system.root() / devices);
  REQUIRE(boards.size() == 2);
  CHECK(boards[0].address == "0000:03:00.0");
  CHECK(boards[0].bound_driver.empty());
  CHECK(boards[0].enabled);
  CHECK(boards[0].accessible);
  CHECK(boards[1].bound_driver == "uio_pci_generic");
  CHECK_FALSE(boards[1].enabled);

  const auto findings = judge(boards);
  CHECK(findings[0].standing == Standing::good);
  CHECK(findings[1].standing == Standing::warning);
  CHECK(findings[1].fix.find("/sys/bus/pci/devices/0000:04:00.0/driver/unbind") != std::string::npos);
  CHECK(findings[1].fix.find("/sys/bus/pci/devices/0000:04:00.0/enable") != std::string::npos);
}

TEST_CASE("registers that cannot be opened are reported with the fix") {
  FakeSystem system;
  put_card(system, "0000:03:00.0", "1");
  std::filesystem::remove(system.root() / (devices + "0000:03:00.0/resource2"));
  const auto findings = judge(find_pci_boards(system.root() / devices));
  CHECK(findings.front().standing == Standing::warning);
  CHECK(findings.front().fix.find("chmod g+rw") != std::string::npos);
}

TEST_CASE("no card is a note: the simulated rig needs none") {
  FakeSystem system;
  CHECK(worst(judge(find_pci_boards(system.root() / devices))) == Standing::note);
}

TEST_CASE(
    "USB boards: a missing board is a note, an inaccessible one gets its udev rule, and all count as unverified") {
  CHECK(worst(judge(std::vector<abs_hil::driver::usb::UsbDevice>{})) == Standing::note);
  FakeSystem system;
  system.put("dev/001/002", "");
  abs_hil::driver::usb::UsbDevice board{.address = "1-1",
                                        .vendor_id = 0x04B4,
                                        .product_id = 0x1003,
                                        .manufacturer = "InTeCo",
                                        .node = system.root() / "dev/001/002"};
  const Finding good = judge(std::vector{board}).front();
  CHECK(good.standing == Standing::good);
  CHECK(good.what.find("04b4:1003 at 1-1") != std::string::npos);
  CHECK(good.detail.find("unverified on hardware") != std::string::npos);
  board.node = system.root() / "dev/001/003";
  const Finding closed = judge(std::vector{board}).front();
  CHECK(closed.standing == Standing::warning);
  CHECK(closed.fix.find(R"(ATTR{idVendor}=="04b4")") != std::string::npos);
}
