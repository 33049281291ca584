// Emulator of the rig's boards with the simulated rig behind them, as a separate process. It emulates an RT-DAC4/PCI
// with a tree like /sys/bus/pci/devices (docs/rig-setup.md), a CAN I/O node (docs/can.md), an RT-DAC/USB2 that is
// plugged into the kernel's virtual host controller (docs/usb.md), or a Mesa 7I92T on the network
// (docs/hm2-emulator.md).

#include <fmt/format.h>
#include <poll.h>
#include <sched.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

#include "cli/command_line.hpp"
#include "config/config_error.hpp"
#include "config/config_file.hpp"
#include "config/key_table.hpp"
#include "control.hpp"
#include "version/build_facts.hpp"

namespace {

using namespace abs_hil;

std::atomic<bool> stop_requested{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may use only lock-free atomics");

using program::BoardKind;
using program::EmulatorOptions;

void plain(cli::Parser& parser, const char* names, const cli::Target& to, const char* help) {
  parser.add(names, to, help);
}
/// The help shows its default.
void shown(cli::Parser& parser, const char* names, const cli::Target& to, const char* help) {
  parser.add(names, to, help, {.show_default = true});
}

void add_card_options(cli::Parser& parser, emulator::BoardOptions& board) {
  shown(parser, "--bitstream", &board.bitstream_version, "version word of the card");
  plain(parser, "--start-speed", &board.start_speed_rad_s, "both wheels' speed at the start, rad/s");
  shown(parser, "--overspeed-rpm", &board.overspeed_rpm, "the FPGA's limit (our choice), rpm");
  shown(parser, "--supply-min", &board.supply_min_V, "the FPGA's limit (our choice), V");
  shown(parser, "--temperature-max", &board.temperature_max_C, "the FPGA's limit (our choice), deg C");
  parser.add("--overspeed-bit", &board.overspeed_bit, "overspeed bit of the trip flags (the sources disagree)",
             {.one_of = {"0", "2"}, .show_default = true});
  plain(parser, "--trip-clears-width", &board.trip_clears_width,
        "a trip also zeroes the PWM width registers (not known of the real card)");
}

void add_usb_options(cli::Parser& parser, EmulatorOptions& emulator) {
  shown(parser, "--usb-serial", &emulator.identity.serial, "serial number of the USB board");
  shown(parser, "--usb-manufacturer", &emulator.identity.manufacturer, "manufacturer string of the USB board");
  shown(parser, "--vhci", &emulator.controller, "folder of the virtual host controller");
  parser.add("--hide-outputs", &emulator.board.shows_outputs,
             "the USB board's frames do not show the sent words (not known of the real board)", {.sets = false});
  plain(parser, "--enable-line", &emulator.board.enable_line,
        "digital line of the USB board, or I/O of the 7I92T, that enables the drive");
  parser.add("--when-braking", &emulator.when_braking,
             "control command of the USB board, obeyed once the brake has acted for 0.3 s", {.repeated = true});
}

void add_hm2_options(cli::Parser& parser, EmulatorOptions& emulator) {
  plain(parser, "--board-name", &emulator.board.name,
        "name that the 7I92T or the node reports, for example 7I92 [7I92T, abs-node]");
  plain(parser, "--mac", &emulator.mac, "MAC address in the EEPROM of the 7I92T or the node: 00:60:1b:16:ab:50");
  parser.add("--wrong-board", &emulator.wrong_words,
             "a word of the 7I92T's description that is another one: 0x458=0x01010204 leaves it one counter",
             {.type = "ADDRESS=VALUE", .repeated = true});
  plain(parser, "--active-high", &emulator.board.active_high_stage,
        "the power stages behind the 7I92T act while their pins are high: wrong wiring, a bite gives full PWM");
}

void add_board_options(cli::Parser& parser, EmulatorOptions& emulator) {
  cli::Parser board = parser.add_group("board", "the board of the rig", {.least = 1, .most = 1});
  board.add("--pci-root", &emulator.pci_root, "emulate a card: folder at which to mount its tree; created if missing",
            {.type = "DIR"});
  board.add("--can", &emulator.can_interface,
            "emulate a CAN I/O node: interface, or unix:PATH of a socket to listen on", {.type = "IFACE"});
  board.add("--usb", &emulator.use_usb, "emulate a USB board, plugged into this computer's vhci_hcd (needs root)");
  board.add("--hm2", &emulator.hm2_address,
            "emulate a Mesa 7I92T: address at which it takes datagrams, with a port if it is not 27181",
            {.type = "ADDRESS[:PORT]"});
  board.add("--node", &emulator.node_address, "emulate the node with the firmware of firmware/: address, as for --hm2",
            {.type = "ADDRESS[:PORT]"});
}

void add_options(cli::Parser& parser, EmulatorOptions& a) {
  add_board_options(parser, a);
  parser.add("--watchdog-ms", &a.board.watchdog_ms,
             "watchdog of the CAN node, ms, until an activation sets another value",
             {.range = {1, 10'000}, .show_default = true});
  shown(parser, "--bdf", &a.bdfs, "the card's address; give it again for more cards, without a rig behind them");
  shown(parser, "--plant", &a.plant, "plant by name or TOML file");
  parser.add("--set", &a.assignments, "any plant value, for example plant.theta_N=30", {.repeated = true});
  shown(parser, "--seed", &a.seed, "seed of intermittent faults and garbage");
  plain(parser, "--lock-step", &a.board.lock_step, "time advances only when the client says so (abs_hil --fast)");
  parser.add("--fault", &a.faults, "fault of one register from the start, for example 88:stuck", {.repeated = true});
  parser.add("--command", &a.commands, "any control command, obeyed at the start", {.repeated = true});
  plain(parser, "--control", &a.control_fifo, "FIFO from which to take commands while running; created if missing");
  parser.add("--truth", &a.truth_file, "CSV of true values that no register or frame shows, every ms",
             {.excludes = {"--can"}});
  parser.add("--record", &a.traffic_file, "log of every register access to the card, one per line",
             {.excludes = {"--can", "--usb", "--hm2", "--node"}});
  shown(parser, "--vendor", &a.vendor, "vendor id of the card");
  shown(parser, "--device", &a.device, "device id of the card");
  shown(parser, "--bar-bytes", &a.bar_bytes, "size of BAR 2");
  parser.add("--bar-kind", &a.bar_kind, "io or memory", {.one_of = {"io", "memory"}, .show_default = true});
  plain(parser, "--cpu", &a.cpu, "CPU to run on; the client's CPU gives short accesses");
  parser.add("--priority", &a.priority, "SCHED_FIFO priority, higher than the client's; 0: none",
             {.range = {0, 98}, .show_default = true});
  add_card_options(parser, a.board);
  add_usb_options(parser, a);
  add_hm2_options(parser, a);
  std::string footer = "Control commands (--command, --control) ";
  for (const BoardKind& kind :
       {program::card_kind(), program::can_node_kind(), program::usb_kind(), program::hm2_kind()})
    footer += fmt::format("of {}:\n{}", kind.name, kind.commands);
  parser.set_footer(footer);
}

void read_plant(EmulatorOptions& a) {
  config::Settings s;
  config::KeyTable keys(s);
  config::load_file(config::plant_file(a.plant), keys, config::Tables::of_plant);
  for (const std::string& assignment : a.assignments) {
    if (!assignment.starts_with("plant.")) {
      throw config::ConfigError("--set " + assignment +
                                ": the emulator takes only plant values, for example plant.theta_N=30");
    }
    keys.set_text(assignment, "--set");
  }
  a.board.plant = s.plant;
}

void pin_to(int cpu) {
  if (cpu < 0) return;
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(static_cast<std::size_t>(cpu), &set);
  if (sched_setaffinity(0, sizeof set, &set) != 0) {
    throw std::runtime_error("--cpu " + std::to_string(cpu) + ": " + std::strerror(errno));
  }
}

/// Requests real time, if permitted: a card answers at once, but an emulator must wait for the CPU.
void take_priority(const EmulatorOptions& a) {
  if (a.priority == 0 || a.board.lock_step) return;
  sched_param wanted{};
  wanted.sched_priority = a.priority;
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0 || sched_setscheduler(0, SCHED_FIFO, &wanted) != 0) {
    program::say(std::string("not in real time (") + std::strerror(errno) +
                 "): expect slow answers; see abs_hil doctor, or give --priority 0");
  }
}

/// Each frame advances the rig to the clock. Between frames this advances it every ms, in steps of 100 us.
constexpr timespec idle{.tv_sec = 0, .tv_nsec = 1'000'000};

/// Serves the board's host and the control FIFO. Ends at a signal, or when the host has gone for good.
void serve_until_stopped(const EmulatorOptions& a, program::EmulatedBoard& board) {
  for (const std::string& fault : a.faults) static_cast<void>(board.obey("fault " + fault));
  for (const std::string& command : a.commands) static_cast<void>(board.obey(command));
  program::ControlFifo control(a.control_fifo);
  program::say("ready: " + board.place());
  bool serving = true;
  while (serving && !stop_requested) {
    std::array<pollfd, 2> ready{{{board.descriptor(), POLLIN, 0}, {control.descriptor(), POLLIN, 0}}};
    timespec wait = idle;
    wait.tv_nsec = std::clamp<std::int64_t>(board.next_due_ns().value_or(idle.tv_nsec), 0, idle.tv_nsec);
    static_cast<void>(::ppoll(ready.data(), ready.size(), &wait, nullptr));
    if (ready[0].revents != 0) serving = board.serve();
    if (ready[1].revents != 0) control.take(board);
    board.catch_up();
  }
  program::say("ended: " + board.status());
}

BoardKind wanted_kind(const EmulatorOptions& a) {
  if (!a.hm2_address.empty() || !a.node_address.empty()) return program::hm2_kind();
  if (a.use_usb) return program::usb_kind();
  if (!a.can_interface.empty()) return program::can_node_kind();
  if (!a.pci_root.empty()) return program::card_kind();
  throw std::invalid_argument("--pci-root, --can, --hm2 and --node need a value that is not empty");
}

int run(int argc, char** argv) {
  // Without a name of its own: its help begins with the path that the user typed.
  cli::Parser parser("",
                     "The ABS rig behind an emulated board: RT-DAC4/PCI card, CAN I/O node, RT-DAC/USB2 or Mesa 7I92T");
  parser.set_version(version::version_line("abs_rig_emulator"));
  EmulatorOptions arguments;
  add_options(parser, arguments);
  if (const std::optional<int> status = parser.parse(argc, argv)) return *status;
  const BoardKind kind = wanted_kind(arguments);
  read_plant(arguments);
  pin_to(arguments.cpu);
  take_priority(arguments);
  serve_until_stopped(arguments, *kind.make(arguments));
  return program::OutputFile::any_lost() ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  struct sigaction action {};
  action.sa_handler = [](int) { stop_requested = true; };
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaction(signal, &action, nullptr);
  try {
    return cli::with_stdout("abs_rig_emulator", run(argc, argv));
  } catch (const std::exception& error) {
    cli::print(stderr, "abs_rig_emulator: {}\n", error.what());
    const bool wrong_input = dynamic_cast<const config::ConfigError*>(&error) != nullptr ||
                             dynamic_cast<const std::invalid_argument*>(&error) != nullptr;
    return wrong_input ? 2 : 3;
  }
}
