// Finding the board among the devices that the kernel shows.

#include <string>

#include "abs_hil/driver/io_result.hpp"
#include "catch.hpp"
#include "diagnosis/fake_system.hpp"
#include "driver/usb/wire.hpp"

using namespace abs_hil::driver;
using namespace abs_hil::driver::usb;
using abs_hil::diagnosis::test::FakeSystem;
using Catch::Matchers::Contains;

namespace {

struct FakeBus {
  FakeSystem system{};
  UsbOptions options{.sysfs_root = (system.root() / "usb").string(), .device_root = (system.root() / "dev").string()};

  void plug(const std::string& address, const std::string& vendor, const std::string& maker, const std::string& serial,
            const std::string& product = "RT-DAC/USB2") {
    const std::string folder = "usb/" + address + "/";
    system.put(folder + "idVendor", vendor).put(folder + "idProduct", "1003").put(folder + "manufacturer", maker);
    system.put(folder + "product", product).put(folder + "serial", serial);
    system.put(folder + "busnum", "1").put(folder + "devnum", "12");
  }
};

}  // namespace

TEST_CASE("A board is found by manufacturer, ids and serial; other devices and interfaces are not") {
  FakeBus bus;
  bus.plug("1-1", "1d6b", "Linux", "0");
  bus.plug("1-1.4", "04b4", "InTeCo", "77");
  bus.system.put("usb/1-1.4:1.0/bInterfaceNumber", "00");
  REQUIRE(find_boards(bus.options).size() == 1);
  const UsbDevice board = find_boards(bus.options).front();
  CHECK(board.text() == "04b4:1003 serial 77 at 1-1.4");
  CHECK(board.node == bus.system.root() / "dev" / "001" / "012");
  CHECK_THAT(udev_rule(board), Contains(R"(ATTR{idVendor}=="04b4", ATTR{idProduct}=="1003", GROUP="abs_hil")"));
  bus.options.vendor_id = 0x04B4;
  CHECK(find_boards(bus.options).size() == 1);
  bus.options.product_id = 0x1004;
  CHECK(find_boards(bus.options).empty());
  bus.options = {.sysfs_root = bus.options.sysfs_root, .manufacturer = "", .serial = "77"};
  CHECK(find_boards(bus.options).empty());  // a serial number alone does not identify a board
}

TEST_CASE("None, several, and one of several") {
  FakeBus bus;
  CHECK_THROWS_WITH(choose_board(bus.options, false, false),
                    Contains("no RT-DAC/USB2 board") && Contains("driver.usb.manufacturer=\"InTeCo\""));
  bus.plug("1-1", "04b4", "InTeCo", "77");
  bus.plug("1-2", "04b4", "InTeCo", "78");
  CHECK_THROWS_WITH(choose_board(bus.options, false, false), Contains("2 boards") && Contains("driver.usb.serial=77"));
  bus.options.serial = "78";
  CHECK(choose_board(bus.options, false, false).address == "1-2");
}

TEST_CASE("Lock-step works only with an emulator in lock-step") {
  FakeBus bus;
  bus.plug("1-1", "1209", "InTeCo", "1");
  CHECK_THROWS_WITH(choose_board(bus.options, true, false), Contains("is hardware, or an emulator in real time"));
  CHECK_THROWS_WITH(choose_board(bus.options, false, true), Contains("is not an emulator, but driver.emulated=true"));
  bus.plug("1-1", "1209", "InTeCo", "1", "RT-DAC/USB2 emulator in lock-step");
  CHECK(choose_board(bus.options, true, true).address == "1-1");
  CHECK_THROWS_WITH(choose_board(bus.options, false, false), Contains("is an emulator in lock-step"));
}

TEST_CASE("A missing device node is named") {
  FakeBus bus;
  bus.plug("1-1", "04b4", "InTeCo", "77");
  CHECK_THROWS_WITH(open_board(bus.options, false, false), Contains("001/012") && Contains("No such file"));
}
