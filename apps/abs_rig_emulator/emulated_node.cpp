#include "emulated_node.hpp"

#include <fmt/format.h>

#include "control_command.hpp"
#include "control_fifo.hpp"
#include "driver/monotonic_time.hpp"

namespace abs_hil::program {

namespace {

const char* name_of(emulator::CanNode::State state) {
  switch (state) {
    case emulator::CanNode::State::inactive: return "inactive";
    case emulator::CanNode::State::active: return "active";
    case emulator::CanNode::State::latched: return "latched";
  }
  return "unknown";
}

}  // namespace

EmulatedNode::EmulatedNode(const emulator::CanNodeOptions& options, std::uint64_t seed)
    : options_(options), node_(options), faults_(seed), started_ns_(driver::monotonic_ns()) {}

void EmulatedNode::power_on() {
  node_ = emulator::CanNode(options_);
  started_ns_ = driver::monotonic_ns();
}

void EmulatedNode::log_events() {
  for (const emulator::NodeEvent& event : node_.take_events()) {
    say(fmt::format("event {:.6f} {}", static_cast<double>(event.time_ns) * 1e-9, event.text));
  }
}

void EmulatedNode::catch_up() {
  if (!options_.lock_step) node_.advance_to(driver::monotonic_ns() - started_ns_);
  log_events();
}

void EmulatedNode::serve(BusSocket& bus) {
  emulator::BusFrame frame;
  while (bus.receive(frame)) {
    if (!faults_.hears(frame)) continue;
    if (!options_.lock_step) node_.advance_to(driver::monotonic_ns() - started_ns_);
    node_.receive(frame);
    for (const emulator::BusFrame& answer : faults_.answer(node_.take_answers())) bus.send(answer);
  }
  log_events();
}

std::string EmulatedNode::status() const {
  const emulator::Outputs out = node_.outputs();
  const auto& state = node_.plant().state();
  return fmt::format(
      "time {:.6f} s, drive {:.4f}, brake {:.4f}, upper {:.2f} rad/s, lower {:.2f} rad/s, trip flags {:#x}, {}, "
      "{} commands rejected",
      static_cast<double>(node_.time_ns()) * 1e-9, out.drive_duty, out.brake_duty, state.omega1_rad_s,
      state.omega2_rad_s, node_.trip_flags(), name_of(node_.state()), node_.rejected());
}

const char* EmulatedNode::commands() {
  return "fault NAME[=NUMBER]             ok silent deaf drop= no-status stale= ahead= stuck duplicate swapped\n"
         "                                wrong-size= corrupt nonsense babble=\n"
         "restart                         the node is switched off and on: inactive, its clock at 0\n"
         "estop on|off                    the emergency stop: cuts the drive only\n"
         "supply V | temperature C        what the node measures\n"
         "overspeed                       latches the overspeed interlock until the wheels stop\n"
         "brake-error DUTY                the brake's duty is off by this from what is commanded\n"
         "status                          duties on the wire, speeds, trip flags, state\n";
}

std::string EmulatedNode::obey(std::string_view line) {
  catch_up();
  const ControlCommand command(line);
  if (command.empty()) return {};
  if (command.is("fault", 1)) {
    faults_.set(command.text(1));
  } else if (command.is("restart", 0)) {
    power_on();
  } else if (command.is("brake-error", 1)) {
    node_.break_brake_output(command.number(1));
  } else if (!obey_surroundings(node_, command) && !command.is("status", 0)) {
    command.refuse(commands());
  }
  return status();
}

}  // namespace abs_hil::program
