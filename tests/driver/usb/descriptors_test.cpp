// Finding the FPGA's interface among a device's descriptors, whole and broken ones.

#include "catch.hpp"
#include "driver/usb/wire.hpp"
#include "usbfs_stand_in.hpp"

using namespace abs_hil::driver::usb;
using Settings = std::vector<abs_hil::test::UsbfsStandIn::Setting>;

namespace {

std::vector<std::uint8_t> bytes_of(std::uint8_t configuration, const Settings& settings) {
  return abs_hil::test::UsbfsStandIn::descriptors_of(configuration, settings);
}

const Settings ours_is_setting_3{{.number = 0, .endpoints = {{0x06}, {0x88}}},
                                 {.number = 1},
                                 {.number = 1, .alternate = 3, .endpoints = {{0x81, 3}, {0x84}, {0x02}}}};

}  // namespace

TEST_CASE("The interface and the setting with both endpoints are found, in any order of these") {
  const auto found = find_interface(bytes_of(1, ours_is_setting_3), 1);
  REQUIRE(found);
  CHECK(found->number == 1);
  CHECK(found->alternate == 3);
}

TEST_CASE("Both endpoints must be bulk, of one setting, and of the active configuration") {
  CHECK_FALSE(find_interface(bytes_of(1, ours_is_setting_3), 2));
  CHECK_FALSE(find_interface(bytes_of(1, {{.endpoints = {{endpoint_out}, {endpoint_in, 3}}}}), 1));
  CHECK_FALSE(find_interface(bytes_of(1, {{.endpoints = {{endpoint_out}, {endpoint_out}}}}), 1));
  CHECK_FALSE(find_interface(bytes_of(1, {{.number = 0, .endpoints = {{endpoint_out}}}, {1, 0, {{endpoint_in}}}}), 1));
  // A second configuration follows the first.
  std::vector<std::uint8_t> both = bytes_of(1, {{.number = 5}});
  const std::vector<std::uint8_t> second = bytes_of(2, ours_is_setting_3);
  both.insert(both.end(), second.begin() + 18, second.end());
  CHECK_FALSE(find_interface(both, 1));
  CHECK(find_interface(both, 2));
}

TEST_CASE("Descriptors of unknown types are passed over; broken ones end the search") {
  std::vector<std::uint8_t> bytes = bytes_of(1, ours_is_setting_3);
  const std::vector<std::uint8_t> unknown{3, 0x41, 0xFF};
  bytes.insert(bytes.begin() + 18 + 9, unknown.begin(), unknown.end());
  CHECK(find_interface(bytes, 1));
  // The last endpoint is the second of the two: nothing shorter has both.
  for (std::size_t length = 0; length < bytes.size(); ++length) {
    CHECK_FALSE(find_interface(std::span(bytes).first(length), 1));
  }
  for (const std::uint8_t length : {std::uint8_t{0}, std::uint8_t{1}, std::uint8_t{255}}) {
    bytes[18 + 9] = length;
    CHECK_FALSE(find_interface(bytes, 1));
  }
  // Too short for what their type says.
  const std::vector<std::uint8_t> stumps{9, 2, 0, 0, 1, 1, 0, 0x80, 50, 2, 4, 2, 5, 3, 5, 0x02, 2, 2};
  CHECK_FALSE(find_interface(stumps, 1));
}
