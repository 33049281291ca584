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
#include <optional>
#include <string>
#include <vector>

#include "cli/command_line.hpp"
#include "cli/standard_output.hpp"
#include "config/config_error.hpp"
#include "config/config_file.hpp"
#include "config/key_table.hpp"
#include "control.hpp"
#include "driver/pci/discovery.hpp"
#include "emulated_card.hpp"
#include "emulated_hm2.hpp"
#include "emulated_node.hpp"
#include "emulated_usb.hpp"
#include "fuse_tree.hpp"

namespace {

using namespace abs_hil;

std::atomic<bool> stop_requested{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may use only lock-free atomics");

struct Arguments {
  program::EmulatorOptions emulator{};
  std::string pci_root{};
  std::string can_interface{};
  program::UsbEmulatorOptions usb{};
  bool use_usb{false};
  program::Hm2EmulatorOptions hm2{};
  std::string node_address{};
  std::uint16_t watchdog_ms{20};
  std::vector<std::string> bdfs{"0000:03:00.0"};
  std::string plant{"paper-table1"};
  std::vector<std::string> assignments{};
  std::vector<std::string> faults{};
  std::vector<std::string> commands{};
  std::string control_fifo{};
  std::string vendor{"0x10b5"};
  std::string device{"0x2497"};
  std::uint32_t bar_bytes{256};
  std::string bar_kind{"io"};
  int cpu{-1};
  int priority{81};
};

void plain(cli::Parser& parser, const char* names, const cli::Target& to, const char* help) {
  parser.add(names, to, help);
}
/// The help shows its default.
void shown(cli::Parser& parser, const char* names, const cli::Target& to, const char* help) {
  parser.add(names, to, help, {.show_default = true});
}

void add_card_options(cli::Parser& parser, emulator::CardOptions& card) {
  shown(parser, "--bitstream", &card.bitstream_version, "version word of the card");
  plain(parser, "--start-speed", &card.start_speed_rad_s, "both wheels' speed at the start, rad/s");
  shown(parser, "--overspeed-rpm", &card.overspeed_rpm, "the FPGA's limit (our choice), rpm");
  shown(parser, "--supply-min", &card.supply_min_V, "the FPGA's limit (our choice), V");
  shown(parser, "--temperature-max", &card.temperature_max_C, "the FPGA's limit (our choice), deg C");
  parser.add("--overspeed-bit", &card.overspeed_bit, "overspeed bit of the trip flags (the sources disagree)",
             {.one_of = {"0", "2"}, .show_default = true});
  plain(parser, "--trip-clears-width", &card.trip_clears_width,
        "a trip also zeroes the PWM width registers (not known of the real card)");
}

void add_usb_options(cli::Parser& parser, program::UsbEmulatorOptions& usb) {
  shown(parser, "--usb-serial", &usb.identity.serial, "serial number of the USB board");
  shown(parser, "--usb-manufacturer", &usb.identity.manufacturer, "manufacturer string of the USB board");
  shown(parser, "--vhci", &usb.controller, "folder of the virtual host controller");
  parser.add("--hide-outputs", &usb.board.shows_outputs,
             "the USB board's frames do not show the sent words (not known of the real board)", {.sets = false});
  plain(parser, "--enable-line", &usb.board.enable_line,
        "digital line of the USB board, or I/O of the 7I92T, that enables the drive");
  parser.add("--when-braking", &usb.when_braking,
             "control command of the USB board, obeyed once the brake has acted for 0.3 s", {.repeated = true});
}

void add_hm2_options(cli::Parser& parser, program::Hm2EmulatorOptions& hm2) {
  hm2.board.name.clear();
  plain(parser, "--board-name", &hm2.board.name,
        "name that the 7I92T or the node reports, for example 7I92 [7I92T, abs-node]");
  plain(parser, "--mac", &hm2.mac, "MAC address in the EEPROM of the 7I92T or the node: 00:60:1b:16:ab:50");
  parser.add("--wrong-board", &hm2.board.lie, "a lie of the 7I92T about itself: " + emulator::Hm2Identity::lies());
  plain(parser, "--active-high", &hm2.board.active_high_stage,
        "the power stages behind the 7I92T act while their pins are high: wrong wiring, a bite gives full PWM");
}

void add_board_options(cli::Parser& parser, Arguments& a) {
  cli::Parser board = parser.add_group("board", "the board of the rig", {.least = 1, .most = 1});
  board.add("--pci-root", &a.pci_root, "emulate a card: folder at which to mount its tree; created if missing",
            {.type = "DIR"});
  board.add("--can", &a.can_interface, "emulate a CAN I/O node: interface, or unix:PATH of a socket to listen on",
            {.type = "IFACE"});
  board.add("--usb", &a.use_usb, "emulate a USB board, plugged into this computer's vhci_hcd (needs root)");
  board.add("--hm2", &a.hm2.address,
            "emulate a Mesa 7I92T: address at which it takes datagrams, with a port if it is not 27181",
            {.type = "ADDRESS[:PORT]"});
  board.add("--node", &a.node_address, "emulate the node with the firmware of firmware/: address, as for --hm2",
            {.type = "ADDRESS[:PORT]"});
}

void add_options(cli::Parser& parser, Arguments& a) {
  add_board_options(parser, a);
  parser.add("--watchdog-ms", &a.watchdog_ms, "watchdog of the CAN node, ms, until an activation sets another value",
             {.range = {1, 10'000}, .show_default = true});
  shown(parser, "--bdf", &a.bdfs, "the card's address; give it again for more cards, without a rig behind them");
  shown(parser, "--plant", &a.plant, "plant by name or TOML file");
  parser.add("--set", &a.assignments, "any plant value, for example plant.theta_N=30", {.repeated = true});
  shown(parser, "--seed", &a.emulator.seed, "seed of intermittent faults and garbage");
  plain(parser, "--lock-step", &a.emulator.lock_step, "time advances only when the client says so (abs_hil --fast)");
  parser.add("--fault", &a.faults, "fault of one register from the start, for example 88:stuck", {.repeated = true});
  parser.add("--command", &a.commands, "any control command, obeyed at the start", {.repeated = true});
  plain(parser, "--control", &a.control_fifo, "FIFO from which to take commands while running; created if missing");
  parser.add("--truth", &a.emulator.truth_file, "CSV of true values that no register or frame shows, every ms",
             {.excludes = {"--can"}});
  parser.add("--record", &a.emulator.traffic_file, "log of every register access to the card, one per line",
             {.excludes = {"--can", "--usb", "--hm2", "--node"}});
  shown(parser, "--vendor", &a.vendor, "vendor id of the card");
  shown(parser, "--device", &a.device, "device id of the card");
  shown(parser, "--bar-bytes", &a.bar_bytes, "size of BAR 2");
  parser.add("--bar-kind", &a.bar_kind, "io or memory", {.one_of = {"io", "memory"}, .show_default = true});
  plain(parser, "--cpu", &a.cpu, "CPU to run on; the client's CPU gives short accesses");
  parser.add("--priority", &a.priority, "SCHED_FIFO priority, higher than the client's; 0: none",
             {.range = {0, 98}, .show_default = true});
  add_card_options(parser, a.emulator.card);
  add_usb_options(parser, a.usb);
  add_hm2_options(parser, a.hm2);
  parser.set_footer(
      std::string("Control commands (--command, --control) of a card:\n") + help_of(program::EmulatedCard::rows()) +
      "of a CAN node:\n" + help_of(program::EmulatedNode::rows()) + "of a USB board:\n" +
      help_of(program::EmulatedUsb::rows()) + "of a 7I92T or a node:\n" + help_of(program::EmulatedHm2::rows()));
}

void read_plant(Arguments& a) {
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
  a.emulator.card.plant = s.plant;
}

/// The files of sysfs that a driver reads.
std::vector<program::ServedFile> files_of(const Arguments& a) {
  constexpr std::uint64_t bar_start = 0xE000;
  const std::string flags = a.bar_kind == "io" ? "0x0000000000040101" : "0x0000000000040200";
  const std::string none = "0x0000000000000000 0x0000000000000000 0x0000000000000000\n";
  const std::string bar2 = fmt::format("0x{:016x} 0x{:016x} {}\n", bar_start, bar_start + a.bar_bytes - 1, flags);
  std::vector<program::ServedFile> files{
      {.name = "vendor", .content = a.vendor + "\n"},
      {.name = "device", .content = a.device + "\n"},
      {.name = "class", .content = "0x068000\n"},
      {.name = "enable", .content = "1\n"},
      {.name = "resource", .content = none + none + bar2 + none + none + none + none},
      {.name = "resource2", .bytes = a.bar_bytes, .registers = true, .mode = 0600}};
  if (a.emulator.lock_step) {
    files.push_back({.name = driver::pci::emulated_time_file, .bytes = 8, .registers = true, .mode = 0600});
  }
  return files;
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
void take_priority(const Arguments& a) {
  if (a.priority == 0 || a.emulator.lock_step) return;
  sched_param wanted{};
  wanted.sched_priority = a.priority;
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0 || sched_setscheduler(0, SCHED_FIFO, &wanted) != 0) {
    program::say(std::string("not in real time (") + std::strerror(errno) +
                 "): expect slow answers; see abs_hil doctor, or give --priority 0");
  }
}

/// Each frame advances the rig to the clock. Between frames this advances it every ms, in steps of 100 us.
constexpr timespec idle{.tv_sec = 0, .tv_nsec = 1'000'000};

template <typename Board>
void obey_first(const Arguments& a, Board& board) {
  for (const std::string& fault : a.faults) static_cast<void>(board.obey("fault " + fault));
  for (const std::string& command : a.commands) static_cast<void>(board.obey(command));
}

/// Serves the host behind `host` and the control FIFO. Ends at a signal, or when the host has gone for good.
template <typename Board, typename Host>
int serve_until_stopped(const Arguments& a, Board& board, const std::string& place, Host& host) {
  program::ControlFifo control(a.control_fifo);
  program::say("ready: " + place);
  bool serving = true;
  while (serving && !stop_requested) {
    std::array<pollfd, 2> ready{{{host.descriptor(), POLLIN, 0}, {control.descriptor(), POLLIN, 0}}};
    timespec wait = idle;
    if constexpr (requires { board.next_due_ns(); }) {
      const std::int64_t due_ns = board.next_due_ns().value_or(idle.tv_nsec);
      wait.tv_nsec = std::clamp<std::int64_t>(due_ns, 0, idle.tv_nsec);
    }
    static_cast<void>(::ppoll(ready.data(), ready.size(), &wait, nullptr));
    if (ready[0].revents != 0) serving = host.serve();
    if (ready[1].revents != 0) control.take([&board](const std::string& line) { return board.obey(line); });
    board.catch_up();
  }
  program::say("ended: " + board.status());
  return 0;
}
template <typename Board>
int serve_board(const Arguments& a, Board&& board, const std::string& place) {
  obey_first(a, board);
  return serve_until_stopped(a, board, place, board);
}

int serve_node(const Arguments& a) {
  const emulator::CardOptions& card = a.emulator.card;
  return serve_board(a,
                     program::EmulatedNode({.plant = card.plant,
                                            .start_speed_rad_s = card.start_speed_rad_s,
                                            .watchdog_ms = a.watchdog_ms,
                                            .lock_step = a.emulator.lock_step,
                                            .supply_min_V = card.supply_min_V,
                                            .temperature_max_C = static_cast<double>(card.temperature_max_C),
                                            .overspeed_rpm = card.overspeed_rpm},
                                           a.emulator.seed, a.can_interface),
                     "CAN node on " + a.can_interface);
}

int serve_usb(Arguments& a) {
  a.usb.board.plant = a.emulator.card.plant;
  a.usb.board.start_speed_rad_s = a.emulator.card.start_speed_rad_s;
  a.usb.seed = a.emulator.seed;
  a.usb.lock_step = a.emulator.lock_step;
  a.usb.truth_file = a.emulator.truth_file;
  program::EmulatedUsb board(a.usb);
  return serve_board(a, board, board.place());
}

int serve_hm2(Arguments& a) {
  a.hm2.board.plant = a.emulator.card.plant;
  a.hm2.board.start_speed_rad_s = a.emulator.card.start_speed_rad_s;
  a.hm2.board.enable_pin = a.usb.board.enable_line;
  a.hm2.board.lock_step = a.emulator.lock_step;
  a.hm2.seed = a.emulator.seed;
  a.hm2.truth_file = a.emulator.truth_file;
  if (!a.node_address.empty()) {
    a.hm2.address = a.node_address;
    a.hm2.is_node = true;
  }
  if (a.hm2.board.name.empty()) a.hm2.board.name = a.hm2.is_node ? "abs-node" : "7I92T";
  program::EmulatedHm2 board(a.hm2);
  return serve_board(a, board, board.place());
}

int serve(Arguments& a) {
  read_plant(a);
  pin_to(a.cpu);
  take_priority(a);
  if (!a.hm2.address.empty() || !a.node_address.empty()) return serve_hm2(a);
  if (a.use_usb) return serve_usb(a);
  if (!a.can_interface.empty()) return serve_node(a);
  program::prepare_mount_folder(a.pci_root);  // first: the other files are often beside it, in the same new folder
  program::EmulatedCard card(a.emulator);
  obey_first(a, card);
  program::FuseTree tree(a.pci_root, a.bdfs, files_of(a), card);
  return serve_until_stopped(a, card, "card " + a.bdfs.front() + " in " + a.pci_root, tree);
}

int run(int argc, char** argv) {
  // Without a name of its own: its help begins with the path that the user typed.
  cli::Parser parser("",
                     "The ABS rig behind an emulated board: RT-DAC4/PCI card, CAN I/O node, RT-DAC/USB2 or Mesa 7I92T");
  Arguments arguments;
  add_options(parser, arguments);
  if (const std::optional<int> status = parser.parse(argc, argv)) return *status;
  if (!arguments.use_usb && arguments.pci_root.empty() && arguments.can_interface.empty() &&
      arguments.hm2.address.empty() && arguments.node_address.empty()) {
    throw std::invalid_argument("--pci-root, --can, --hm2 and --node need a value that is not empty");
  }
  const int status = serve(arguments);
  return status == 0 && program::OutputFile::any_lost() ? 1 : status;
}

}  // namespace

int main(int argc, char** argv) {
  struct sigaction action {};
  action.sa_handler = [](int) { stop_requested = true; };
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaction(signal, &action, nullptr);
  try {
    return cli::with_stdout("abs_rig_emulator", run(argc, argv));
  } catch (const config::ConfigError& error) {
    fmt::print(stderr, "abs_rig_emulator: {}\n", error.what());
    return 2;
  } catch (const std::invalid_argument& error) {
    fmt::print(stderr, "abs_rig_emulator: {}\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    fmt::print(stderr, "abs_rig_emulator: {}\n", error.what());
    return 3;
  }
}
