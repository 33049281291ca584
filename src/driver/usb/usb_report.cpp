// Texts about the board.

#include "driver/usb/usb_driver.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::driver::usb {

namespace {

using rig::formatted;

std::string text_of(std::string_view view) { return std::string(view); }

}  // namespace

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
  IoResult result = board_.link->answer_outstanding() ? IoResult{} : board_.link->request();
  std::span<const std::uint8_t> bytes;
  constexpr std::int64_t second_ns = 1'000'000'000;
  if (result.ok()) result = board_.link->receive(second_ns, bytes);
  if (!result.ok()) return {"no frame: " + error_text(result)};
  std::vector<std::string> lines;
  for (const WordGroup& group : words()) {
    if (group.name == "-") continue;
    std::string line = formatted("%3zu  %-21s", group.first, text_of(group.name).c_str());
    constexpr std::size_t most_shown = 16;
    for (std::size_t i = 0; i < group.count && i < most_shown; ++i) {
      line += formatted("%04x ", word_at(bytes, group.first + i));
    }
    if (group.count > most_shown) line += "... ";
    line += formatted(" %s, %s", text_of(name_of(group.standing)).c_str(), text_of(name_of(group.use)).c_str());
    if (!group.open.empty()) line += "; not known: " + text_of(group.open);
    lines.push_back(std::move(line));
  }
  return lines;
}

}  // namespace abs_hil::driver::usb
