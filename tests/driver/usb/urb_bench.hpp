#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "abs_hil/driver/io_result.hpp"
#include "diagnosis/fake_system.hpp"
#include "driver/usb/wire.hpp"
#include "usbfs_stand_in.hpp"

namespace abs_hil::driver::usb::test_bench {

using abs_hil::diagnosis::test::FakeSystem;
using test::UsbfsStandIn;

inline constexpr std::int64_t ms = 1'000'000;

/// A stand-in whose device has the FPGA's interface, and one of its JTAG before it.
struct UrbBench {
  explicit UrbBench(std::uint8_t alternate = 0) {
    put_settings({{.number = 0, .endpoints = {{0x06}, {0x88}}},
                  {.number = 1, .alternate = alternate, .endpoints = {{endpoint_out}, {endpoint_in}}}});
    const std::string folder = "usb/1-1.4/";
    system.put(folder + "idVendor", "04b4").put(folder + "idProduct", "1003").put(folder + "manufacturer", "InTeCo");
    system.put(folder + "serial", "77").put(folder + "busnum", "1").put(folder + "devnum", "12");
    system.put(folder + "product", "RT-DAC/USB2 emulator in lock-step").put(folder + "bConfigurationValue", "1");
  }
  void put_settings(const std::vector<UsbfsStandIn::Setting>& settings) {
    usb.descriptors = UsbfsStandIn::descriptors_of(1, settings);
  }
  [[nodiscard]] UsbOptions options() const {
    return {.sysfs_root = (system.root() / "usb").string(), .device_root = (system.root() / "dev").string()};
  }
  [[nodiscard]] UsbDevice device() const { return find_boards(options()).at(0); }
  FakeSystem system{};
  UsbfsStandIn usb{};
};

/// A link, and a frame's whole way with it.
struct OpenUrbBench : UrbBench {
  std::unique_ptr<FrameLink> own{urb_link(device(), usb)};
  FrameLink& link{*own};
};

inline Frame frame_of(std::uint8_t value) {
  Frame frame{};
  frame.fill(value);
  return frame;
}

inline std::vector<std::uint8_t> bytes_of(std::span<const std::uint8_t> bytes) { return {bytes.begin(), bytes.end()}; }

inline IoResult received(FrameLink& link, std::vector<std::uint8_t>& bytes, std::int64_t timeout_ns = 0) {
  std::span<const std::uint8_t> view;
  const IoResult result = link.receive(timeout_ns, view);
  bytes = bytes_of(view);
  return result;
}

}  // namespace abs_hil::driver::usb::test_bench
