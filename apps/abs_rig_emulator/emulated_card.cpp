#include "emulated_card.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "control_command.hpp"
#include "driver/pci/discovery.hpp"
#include "runtime/clock.hpp"

namespace abs_hil::program {

namespace {

std::int64_t monotonic_ns() { return runtime::MonotonicClock().now_ns(); }

void wait_for(std::int64_t duration_ns) {
  runtime::MonotonicClock clock;
  clock.sleep_until(clock.now_ns() + duration_ns);
}

}  // namespace

EmulatedCard::EmulatedCard(const EmulatorOptions& options)
    : model_(options.card),
      faulty_(model_, options.seed),
      lock_step_(options.lock_step),
      started_ns_(monotonic_ns()),
      truth_(options.truth_file, true) {
  if (!options.traffic_file.empty()) record_to(options.traffic_file);
}

void EmulatedCard::record_to(const std::string& file) { open_for_writing(traffic_, file); }

void EmulatedCard::catch_up() {
  if (!lock_step_) truth_.advance(model_, monotonic_ns() - started_ns_);
}

void EmulatedCard::record(char direction, std::uint64_t offset, std::uint32_t value) {
  if (traffic_.is_open()) traffic_ << fmt::format("{} {:02X} {:08x}\n", direction, offset, value);
}

void EmulatedCard::note_change() {
  const emulator::PwmWidths& w = model_.pwm_widths();
  const std::pair now{w.drive, w.brake};
  if (std::exchange(last_widths_, now) == now) return;
  changes_ << fmt::format("{} {} {}\n", started_ns_ + w.last_written_ns, w.drive, w.brake);
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
    truth_.advance(model_, time_ns);
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
  const emulator::Outputs out = model_.outputs();
  const auto& state = model_.plant().state();
  return fmt::format(
      "time {:.3f} s, drive {:.4f}, brake {:.4f}, upper {:.2f} rad/s, lower {:.2f} rad/s, trip flags {:#x}",
      static_cast<double>(model_.time_ns()) * 1e-9, out.drive_duty, out.brake_duty, state.omega1_rad_s,
      state.omega2_rad_s, model_.trip_flags());
}

std::string EmulatedCard::widths() const {
  const emulator::PwmWidths& w = model_.pwm_widths();
  const auto text = [start_ns = lock_step_ ? 0 : started_ns_](std::int64_t time_ns) {
    return fmt::format("{} ns", start_ns + time_ns);
  };
  return fmt::format("drive {}, brake {}, {}, last written at {}", w.drive, w.brake,
                     w.drive == 0 && w.brake == 0 ? "both 0 since " + text(w.zero_since_ns) : "not both 0",
                     text(w.last_written_ns));
}

const char* EmulatedCard::commands() {
  return "fault OFFSET:KIND[=PARAMETER]   one register: ok stuck wrong= slow= delayed= intermittent= off garbage\n"
         "unplug | plug                   the card's files disappear, reappear\n"
         "all-ones on|off                 the card leaves the bus, its files stay\n"
         "deny on|off                     opening the registers is forbidden\n"
         "estop on|off                    the emergency stop: cuts the drive only\n"
         "supply V | temperature C        what the board measures\n"
         "overspeed                       latches the overspeed interlock until the wheels stop\n"
         "turn upper|lower REVOLUTIONS    a wheel is turned by hand\n"
         "record FILE | record off        register accesses: R or W, offset, value\n"
         "changes FILE | changes off      each change of a PWM's width: when, ns of CLOCK_MONOTONIC, drive, brake\n"
         "widths                          both PWM width registers, since when both are 0, time of the last write; ns "
         "of CLOCK_MONOTONIC, in lock-step of the card's time\n"
         "status                          duties on the wire, speeds, trip flags\n";
}

std::string EmulatedCard::obey(std::string_view line) {
  catch_up();
  const ControlCommand command(line);
  if (command.empty()) return {};
  if (command.is("fault", 1)) {
    faulty_.set(command.text(1));
  } else if (command.is("unplug", 0) || command.is("plug", 0)) {
    present_ = command.name() == "plug";
  } else if (command.is("all-ones", 1)) {
    faulty_.answer_all_ones(command.on(1));
  } else if (command.is("deny", 1)) {
    permission_denied_ = command.on(1);
  } else if (command.is("record", 1)) {
    if (command.text(1) == "off") {
      traffic_.close();
    } else {
      record_to(command.text(1));
    }
  } else if (command.is("changes", 1)) {
    if (command.text(1) == "off") {
      changes_.close();
    } else {
      open_for_writing(changes_, command.text(1));
    }
  } else if (command.is("widths", 0)) {
    return widths();
  } else if (!obey_surroundings(model_, command) && !obey_turn(model_, command) && !command.is("status", 0)) {
    command.refuse(commands());
  }
  return status();
}

}  // namespace abs_hil::program
