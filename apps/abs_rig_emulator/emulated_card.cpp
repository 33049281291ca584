// The emulated RT-DAC4/PCI as files: registers behind a tree that FUSE shows.
#include "emulated_card.hpp"

#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "driver/pci/discovery.hpp"
#include "runtime/clock.hpp"

namespace abs_hil::program {

namespace {

void wait_for(std::int64_t duration_ns) {
  runtime::MonotonicClock clock;
  clock.sleep_until(clock.now_ns() + duration_ns);
}

}  // namespace

EmulatedCard::EmulatedCard(const EmulatorOptions& options)
    : model_(options.card), faulty_(model_, options.seed), time_(options.lock_step, options.truth_file, true) {
  if (!options.traffic_file.empty()) traffic_.begin(options.traffic_file);
}

void EmulatedCard::record(char direction, std::uint64_t offset, std::uint32_t value) {
  if (traffic_.is_open()) traffic_ << fmt::format("{} {:02X} {:08x}\n", direction, offset, value);
}

void EmulatedCard::note_change() {
  const emulator::PwmWidths& w = model_.pwm_widths();
  const std::pair now{w.drive, w.brake};
  if (std::exchange(last_widths_, now) == now) return;
  changes_ << fmt::format("{} {} {}\n", time_.start_ns() + w.last_written_ns, w.drive, w.brake);
}

int EmulatedCard::open(std::string_view /*name*/) { return permission_denied_ ? -EACCES : 0; }

int EmulatedCard::read(std::string_view name, std::uint64_t offset, void* data, std::size_t size) {
  if (name == driver::pci::emulated_time_file) {
    const std::int64_t time_ns = model_.time_ns();
    if (offset != 0 || size != sizeof time_ns) return -EINVAL;
    std::memcpy(data, &time_ns, sizeof time_ns);
    return sizeof time_ns;
  }
  // The kernel splits other sizes into 1- and 2-byte port accesses, which the card does not have.
  if (size != sizeof(std::uint32_t) || offset % 4 != 0 || offset >= emulator::CardModel::bytes) return -EINVAL;
  catch_up();
  const emulator::AccessResult result = faulty_.read32(static_cast<std::uint32_t>(offset));
  if (result.delay_ns > 0) wait_for(result.delay_ns);
  if (result.failed) return -EIO;
  record('R', offset, result.value);
  std::memcpy(data, &result.value, sizeof result.value);
  return sizeof result.value;
}

int EmulatedCard::write(std::string_view name, std::uint64_t offset, const void* data, std::size_t size) {
  if (name == driver::pci::emulated_time_file) {
    std::int64_t time_ns = 0;
    if (offset != 0 || size != sizeof time_ns) return -EINVAL;
    std::memcpy(&time_ns, data, sizeof time_ns);
    time_.advance(model_, time_ns);
    return sizeof time_ns;
  }
  if (size != sizeof(std::uint32_t) || offset % 4 != 0 || offset >= emulator::CardModel::bytes) return -EINVAL;
  catch_up();
  std::uint32_t value = 0;
  std::memcpy(&value, data, sizeof value);
  const emulator::AccessResult result = faulty_.write32(static_cast<std::uint32_t>(offset), value);
  if (result.delay_ns > 0) wait_for(result.delay_ns);
  if (result.failed) return -EIO;
  record('W', offset, value);
  if (changes_.is_open()) note_change();
  return sizeof value;
}

std::string EmulatedCard::status() const {
  return fmt::format("{}, trip flags {:#x}", state_text(model_), model_.trip_flags());
}

std::string EmulatedCard::widths() const {
  const emulator::PwmWidths& w = model_.pwm_widths();
  const auto text = [&](std::int64_t time_ns) { return fmt::format("{} ns", time_.start_ns() + time_ns); };
  return fmt::format("drive {}, brake {}, {}, last written at {}", w.drive, w.brake,
                     w.drive == 0 && w.brake == 0 ? "both 0 since " + text(w.zero_since_ns) : "not both 0",
                     text(w.last_written_ns));
}

std::span<const ControlRow<EmulatedCard>> EmulatedCard::rows() {
  using Card = EmulatedCard;
  using Command = ControlCommand;
  static constexpr std::array<ControlRow<Card>, 13> all{{
      {"fault OFFSET:KIND[=PARAMETER]", "one register: ok stuck wrong= slow= delayed= intermittent= off garbage",
       [](Card& card, const Command& c) { card.faulty_.set(c.text(1)); }},
      {"unplug", "the card's files disappear", [](Card& card, const Command&) { card.present_ = false; }},
      {"plug", "they reappear", [](Card& card, const Command&) { card.present_ = true; }},
      {"all-ones on|off", "the card leaves the bus, its files stay",
       [](Card& card, const Command& c) { card.faulty_.answer_all_ones(c.on(1)); }},
      {"deny on|off", "opening the registers is forbidden",
       [](Card& card, const Command& c) { card.permission_denied_ = c.on(1); }},
      estop_row<Card>,
      supply_row<Card>,
      temperature_row<Card>,
      overspeed_row<Card>,
      turn_row<Card>,
      {"record FILE|off", "register accesses: R or W, offset, value",
       [](Card& card, const Command& c) { card.traffic_.begin(c.text(1)); }},
      {"changes FILE|off", "each change of a PWM's width: when, ns as in \"widths\", drive, brake",
       [](Card& card, const Command& c) { card.changes_.begin(c.text(1)); }},
      {.usage = "widths",
       .meaning = "both PWM width registers, since when both are 0, time of the last write; ns of CLOCK_MONOTONIC, in "
                  "lock-step of the card's time",
       .answer = &Card::widths},
  }};
  return all;
}

std::string EmulatedCard::obey(std::string_view line) {
  catch_up();
  return obey_line(*this, line);
}

}  // namespace abs_hil::program
