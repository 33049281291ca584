// What the USB backend tells people about a board that it cannot open.
#include <stdexcept>

#include "catch.hpp"
#include "diagnosis/fake_system.hpp"
#include "driver/board_options.hpp"

using namespace abs_hil::driver;
using namespace abs_hil::driver::usb;
using abs_hil::diagnosis::test::FakeSystem;
using Catch::Matchers::Contains;

TEST_CASE("A USB board that cannot be opened gets its udev rule, and all count as unverified") {
  FakeSystem system;
  const UsbOptions options{.sysfs_root = (system.root() / "usb").string(),
                           .device_root = (system.root() / "dev").string()};
  const Backend entry = usb_backend();
  const auto found = [&] { return entry.find(BoardOptions::of(options)); };
  CHECK(found().empty());
  system.put("usb/1-1/idVendor", "04b4").put("usb/1-1/idProduct", "1003").put("usb/1-1/manufacturer", "InTeCo");
  system.put("usb/1-1/busnum", "1").put("usb/1-1/devnum", "12").put("usb/1-1/serial", "77");
  REQUIRE(found().size() == 1);
  CHECK_THAT(found().front().what, Contains("04b4:1003 serial 77 at 1-1"));
  CHECK_THAT(found().front().detail, Contains("unverified on hardware"));
  CHECK(found().front().selection == std::vector<std::string>{"driver.usb.serial=77"});
  REQUIRE(found().front().obstacles.size() == 1);
  CHECK_THAT(found().front().obstacles.front().fix, Contains(R"(ATTR{idVendor}=="04b4")"));
  system.put("dev/001/012", "");
  CHECK(found().front().obstacles.empty());
}
