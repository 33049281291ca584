// The registry's entry for driver.kind=usb, and what the driver tells people.

#include <cmath>
#include <stdexcept>
#include <string>

#include "driver/file_descriptor.hpp"
#include "driver/monotonic_time.hpp"
#include "driver/own_handle_writer.hpp"
#include "driver/usb/usb_driver.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::driver::usb {

namespace {

using rig::formatted;

std::unique_ptr<RigDriver> make_usb_driver(const UsbOptions& options, const RunFacts& run) {
  UsbOptions usb = options;
  usb.encoder_counts_per_rev = run.encoder_counts_per_rev;
  return std::make_unique<UsbDriver>(
      usb, [usb, run] { return open_board(usb, run.lock_step, run.emulated); }, run.lock_step ? nullptr : monotonic_ns);
}

std::unique_ptr<SafeStateWriter> make_usb_writer(const UsbOptions& options, const RunFacts& run) {
  return safe_state_writer(options, [options, run, again = Reopening{}]() mutable {
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

std::vector<std::string> UsbDriver::notes() const {
  if (!board_.link) return {};
  std::vector<std::string> notes;
  notes.push_back("USB board " + board_.place + ": opened and claimed");
  notes.push_back(formatted("version word 0x%04x (%s), channel counts %04x %04x %04x", identity_[word::version],
                            options_.version >= 0 ? "as configured" : "not compared: driver.usb.version is not set",
                            identity_[word::channel_counts], identity_[word::channel_counts + 1],
                            identity_[word::channel_counts + 2]));
  const auto prescaler = static_cast<std::uint32_t>(options_.pwm_prescaler);
  notes.push_back(formatted(
      "PWM %d drive, %d brake, %s, prescaler %u: %.4g Hz if its clock is that of the PCI board; drive duty at "
      "most %.3g, brake duty at most %.3g",
      options_.drive_pwm, options_.brake_pwm, options_.pwm_mode.c_str(), prescaler, pwm_frequency_Hz(mode_, prescaler),
      options_.motor_duty_max, options_.brake_duty_max));
  notes.push_back(options_.verify_outputs
                      ? "every frame must show the PWM words that were sent"
                      : "the driver does not check the PWM words in the frames (driver.usb.verify_outputs=false): the "
                        "safe state is sent and accepted, but not verified");
  notes.push_back(
      formatted("a cycle waits at most %d us for its frame; supply, temperature and interlocks are not known",
                options_.answer_timeout_us));
  notes.emplace_back(
      "the board has no known watchdog: if this program dies or the cable is unplugged, the PWMs are assumed to hold "
      "their duties: press the E-stop");
  return notes;
}

std::vector<std::string> UsbDriver::tally() const {
  return {formatted("USB board: %llu cycles without their frame", static_cast<unsigned long long>(frames_lost_))};
}

std::vector<std::string> UsbDriver::inspection() {
  if (!board_.link) return {};
  std::span<const std::uint8_t> bytes;
  const IoResult result = fresh_answer(*board_.link, patient_ns, bytes);
  if (!result.ok()) return {"no frame: " + error_text(result)};
  std::vector<std::string> lines;
  for (const WordGroup& group : words()) {
    if (group.name == "-") continue;
    std::string line = formatted("%3zu  %-21s", group.first, std::string(group.name).c_str());
    constexpr std::size_t most_shown = 16;
    for (std::size_t i = 0; i < group.count && i < most_shown; ++i) {
      line += formatted("%04x ", word_at(bytes, group.first + i));
    }
    if (group.count > most_shown) line += "... ";
    line += formatted(" %s, %s", std::string(name_of(group.standing)).c_str(), std::string(name_of(group.use)).c_str());
    if (!group.open.empty()) line += "; not known: " + std::string(group.open);
    lines.push_back(std::move(line));
  }
  return lines;
}

}  // namespace abs_hil::driver::usb
