#include "driver/usb/usb_backend.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

#include "driver/file_descriptor.hpp"
#include "driver/monotonic_time.hpp"
#include "driver/own_handle_writer.hpp"
#include "driver/pwm.hpp"
#include "driver/usb/discovery.hpp"
#include "driver/usb/urb_link.hpp"
#include "driver/usb/usb_driver.hpp"
#include "driver/usb/usb_safe_state.hpp"

namespace abs_hil::driver::usb {

namespace {

std::unique_ptr<RigDriver> make_usb_driver(const UsbOptions& options, const RunFacts& run) {
  UsbOptions usb = options;
  usb.encoder_counts_per_rev = run.encoder_counts_per_rev;
  return std::make_unique<UsbDriver>(
      usb, [usb, run] { return open_board(usb, run.lock_step, run.emulated); }, run.lock_step ? nullptr : monotonic_ns);
}

std::unique_ptr<SafeStateWriter> make_usb_writer(const UsbOptions& options, const RunFacts& run) {
  return std::make_unique<UsbSafeState>(options, [options, run, again = Reopening{}]() mutable {
    if (!again.due()) return Board{};
    Board board = open_board(options, false, run.emulated);
    again.found(options.sysfs_root + '/' + board.address);
    return board;
  });
}

/// A cycle must not wait for an answer longer than its period.
void refuse_slow_answers(const UsbOptions& options, const RunFacts& run) {
  if (run.lock_step || options.answer_timeout_us * run.rate_Hz < 1e6) return;
  throw std::invalid_argument("driver.usb.answer_timeout_us = " + std::to_string(options.answer_timeout_us) +
                              ": a cycle must not wait longer than its period; give a value below " +
                              std::to_string(std::llround(1e6 / run.rate_Hz)) + " or a lower control.rate_Hz");
}

std::vector<FoundBoard> survey_boards(const UsbOptions& options) {
  std::vector<FoundBoard> found;
  for (const UsbDevice& device : find_boards(options)) {
    FoundBoard board{
        .what = "RT-DAC/USB2 " + device.text(),
        .detail = "\"" + device.manufacturer + "\", \"" + device.product + "\"; this driver is unverified on hardware"};
    if (!device.serial.empty()) board.selection.push_back("driver.usb.serial=" + device.serial);
    board.files.push_back(device.node.string());
    if (!can_be_opened(device.node)) {
      board.obstacles.push_back(
          {device.node.string() + " not accessible to this user",
           "put this line into /etc/udev/rules.d/70-abs-hil.rules and plug the board in again (docs/usb.md):\n" +
               udev_rule(device)});
    }
    found.push_back(std::move(board));
  }
  return found;
}

}  // namespace

Backend usb_backend() {
  return backend<UsbOptions>({
      .name = "usb",
      .summary = "RT-DAC/USB2 with generic logic; unverified on hardware",
      .not_verified =
          "The frame format comes from the maker's documents and has been tested only with an emulator. The board has "
          "no known watchdog. Do the checks of docs/usb.md and docs/rig-setup.md with abs_hil commission",
      .make_driver = make_usb_driver,
      .make_safe_state_writer = make_usb_writer,
      .outputs = pwm_grid<UsbOptions>,
      .find = survey_boards,
      .check = refuse_slow_answers,
      .free_options = {"sysfs_root", "device_root", "vendor_id", "product_id", "manufacturer", "serial", "version",
                       "answer_timeout_us", "plausible_speed_rad_s"},
  });
}

}  // namespace abs_hil::driver::usb
