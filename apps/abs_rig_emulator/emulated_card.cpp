#include "emulated_card.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <vector>

#include "abs_hil/driver/pci/discovery.hpp"
#include "abs_hil/runtime/clock.hpp"
#include "control_fifo.hpp"
#include "truth_file.hpp"

namespace abs_hil::app {

namespace {

constexpr std::int64_t truth_period_ns = 1'000'000;

std::int64_t monotonic_ns() { return runtime::MonotonicClock().now_ns(); }

void wait_for(std::int64_t duration_ns) {
  runtime::MonotonicClock clock;
  clock.sleep_until(clock.now_ns() + duration_ns);
}

}  // namespace

EmulatedCard::EmulatedCard(const EmulatorOptions& options)
    : model_(options.card), faulty_(model_, options.seed), lock_step_(options.lock_step), started_ns_(monotonic_ns()) {
  if (!options.truth_file.empty()) {
    open_for_writing(truth_, options.truth_file);
    truth_ << "time_s,omega1_rad_s,omega2_rad_s,slip,brake_torque_Nm,theta_N,drive_duty,brake_duty,trip_flags\n";
  }
  if (!options.traffic_file.empty()) record_to(options.traffic_file);
}

void EmulatedCard::record_to(const std::string& file) { open_for_writing(traffic_, file); }

void EmulatedCard::log_truth() {
  const rig::PlantTruth truth = model_.plant().truth();
  const emulator::Outputs out = model_.outputs();
  truth_ << fmt::format("{:.6f},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.6f},{:.6f},{}\n",
                        static_cast<double>(model_.time_ns()) * 1e-9, truth.speeds.omega1_rad_s,
                        truth.speeds.omega2_rad_s, truth.slip, truth.brake_torque_Nm, truth.theta_N, out.drive_duty,
                        out.brake_duty, model_.trip_flags());
}

void EmulatedCard::go_on_to(std::int64_t time_ns) {
  while (truth_.is_open() && next_truth_ns_ <= time_ns) {
    model_.advance_to(next_truth_ns_);
    log_truth();
    next_truth_ns_ += truth_period_ns;
  }
  model_.advance_to(time_ns);
}

void EmulatedCard::catch_up() {
  if (!lock_step_) go_on_to(monotonic_ns() - started_ns_);
}

void EmulatedCard::record(char direction, std::uint64_t offset, std::uint32_t value) {
  if (traffic_.is_open()) traffic_ << fmt::format("{} {:02X} {:08x}\n", direction, offset, value);
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
    go_on_to(time_ns);
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
         "unplug | plug                   the card's files vanish, come back\n"
         "all-ones on|off                 the card leaves the bus, its files stay\n"
         "deny on|off                     opening the registers is not permitted\n"
         "estop on|off                    the emergency stop: cuts the drive only\n"
         "supply V | temperature C        what the board measures\n"
         "overspeed                       latches the overspeed interlock until the wheels stop\n"
         "turn upper|lower REVOLUTIONS    a wheel is turned by hand\n"
         "record FILE | record off        register accesses: R or W, offset, value\n"
         "widths                          both PWM width registers; since when both are 0 and when last written, ns of "
         "CLOCK_MONOTONIC, in lock-step of the card's time\n"
         "status                          duties on the wire, speeds, trip flags\n";
}

std::string EmulatedCard::obey(std::string_view line) {
  catch_up();
  const std::vector<std::string> words = words_of(line);
  const auto is = [&words](std::string_view name, std::size_t arguments) {
    return words[0] == name && words.size() == arguments + 1;
  };
  if (words.empty()) return {};
  if (is("fault", 1)) {
    faulty_.set(words[1]);
  } else if (is("unplug", 0) || is("plug", 0)) {
    present_ = words[0] == "plug";
  } else if (is("all-ones", 1)) {
    faulty_.answer_all_ones(on_or_off(words[1]));
  } else if (is("deny", 1)) {
    permission_denied_ = on_or_off(words[1]);
  } else if (is("estop", 1)) {
    model_.press_emergency_stop(on_or_off(words[1]));
  } else if (is("supply", 1)) {
    model_.set_supply_V(number_in(words[1]));
  } else if (is("temperature", 1)) {
    model_.set_temperature_C(number_in(words[1]));
  } else if (is("overspeed", 0)) {
    model_.trip_overspeed();
  } else if (is("turn", 2) && (words[1] == "upper" || words[1] == "lower")) {
    model_.turn_by_hand(words[1] == "upper", number_in(words[2]));
  } else if (is("record", 1)) {
    if (words[1] == "off") {
      traffic_.close();
    } else {
      record_to(words[1]);
    }
  } else if (is("widths", 0)) {
    return widths();
  } else if (!is("status", 0)) {
    throw std::invalid_argument("unknown command \"" + std::string(line) + "\"; known are\n" + commands());
  }
  return status();
}

}  // namespace abs_hil::app
