// The device side of the rig as a process of its own: an emulated RT-DAC4/PCI with the simulated rig behind it, served
// as a tree like /sys/bus/pci/devices (docs/rig-setup.md).

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <filesystem>
#include <string>
#include <vector>

#include "abs_hil/driver/pci/discovery.hpp"
#include "abs_hil/driver/pci/sysfs_window.hpp"
#include "abs_hil/settings/config_error.hpp"
#include "abs_hil/settings/config_file.hpp"
#include "abs_hil/settings/key_table.hpp"
#include "emulated_card.hpp"
#include "fuse_tree.hpp"

namespace {

using namespace abs_hil;

std::atomic<bool> stop_requested{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may touch nothing else");

struct Arguments {
  app::EmulatorOptions emulator{};
  std::string pci_root{};
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

void add_card_options(CLI::App& cli, emulator::CardOptions& card) {
  cli.add_option("--bitstream", card.bitstream_version, "version word that the card shows")->capture_default_str();
  cli.add_option("--start-speed", card.start_speed_rad_s, "both wheels' speed at the start, rad/s");
  cli.add_option("--overspeed-rpm", card.overspeed_rpm, "the FPGA's limit, ours")->capture_default_str();
  cli.add_option("--supply-min", card.supply_min_V, "the FPGA's limit, V, ours")->capture_default_str();
  cli.add_option("--temperature-max", card.temperature_max_C, "the FPGA's limit, deg C, ours")->capture_default_str();
  cli.add_option("--overspeed-bit", card.overspeed_bit, "bit of the trip flags: the sources disagree")
      ->check(CLI::IsMember({0, 2}))
      ->capture_default_str();
  cli.add_flag("--trip-clears-width", card.trip_clears_width, "a trip zeroes the PWM width registers too: not known");
}

void add_options(CLI::App& cli, Arguments& a) {
  cli.add_option("--pci-root", a.pci_root, "folder to mount the tree at; made if it is not there")
      ->required()
      ->type_name("DIR");
  cli.add_option("--bdf", a.bdfs, "the card's address; repeated: more cards, for show")->capture_default_str();
  cli.add_option("--plant", a.plant, "plant by name or TOML file")->capture_default_str();
  cli.add_option("--set", a.assignments, "any plant value, plant.theta_N=30 say")->allow_extra_args(false);
  cli.add_option("--seed", a.emulator.seed, "of intermittent faults and garbage")->capture_default_str();
  cli.add_flag("--lock-step", a.emulator.lock_step, "time goes on only when the client says so (abs_hil --fast)");
  cli.add_option("--fault", a.faults, "fault of one register from the start, 88:stuck say")->allow_extra_args(false);
  cli.add_option("--command", a.commands, "any control command, obeyed at the start")->allow_extra_args(false);
  cli.add_option("--control", a.control_fifo, "FIFO to take commands from while running; made if it is not there");
  cli.add_option("--truth", a.emulator.truth_file, "CSV of what no register shows, every ms");
  cli.add_option("--record", a.emulator.traffic_file, "every register access, one a line");
  cli.add_option("--vendor", a.vendor, "what the card says it is")->capture_default_str();
  cli.add_option("--device", a.device, "what the card says it is")->capture_default_str();
  cli.add_option("--bar-bytes", a.bar_bytes, "size of BAR 2")->capture_default_str();
  cli.add_option("--bar-kind", a.bar_kind, "io or memory")
      ->check(CLI::IsMember({"io", "memory"}))
      ->capture_default_str();
  cli.add_option("--cpu", a.cpu, "CPU to run on: the client's, for short accesses");
  cli.add_option("--priority", a.priority, "SCHED_FIFO priority, above the client's; 0: none")
      ->check(CLI::Range(0, 98))
      ->capture_default_str();
  add_card_options(cli, a.emulator.card);
  cli.footer(std::string("Control commands (--command, --control):\n") + app::EmulatedCard::commands());
}

void read_plant(Arguments& a) {
  settings::Settings s;
  settings::KeyTable keys(s);
  settings::load_file(settings::plant_file(a.plant), keys, "plant");
  for (const std::string& assignment : a.assignments) {
    if (!assignment.starts_with("plant.")) {
      throw settings::ConfigError("--set " + assignment + ": the emulator takes plant values alone");
    }
    keys.set_text(assignment, "--set");
  }
  a.emulator.card.plant = s.plant;
}

/// The files of sysfs that a driver looks at.
std::vector<app::ServedFile> files_of(const Arguments& a) {
  constexpr std::uint64_t bar_start = 0xE000;
  const std::string flags = a.bar_kind == "io" ? "0x0000000000040101" : "0x0000000000040200";
  const std::string none = "0x0000000000000000 0x0000000000000000 0x0000000000000000\n";
  const std::string bar2 = fmt::format("0x{:016x} 0x{:016x} {}\n", bar_start, bar_start + a.bar_bytes - 1, flags);
  std::vector<app::ServedFile> files{{.name = "vendor", .content = a.vendor + "\n"},
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

driver::pci::FileDescriptor open_control(const std::string& fifo) {
  if (fifo.empty()) return driver::pci::FileDescriptor(-1);
  if (::mkfifo(fifo.c_str(), 0600) != 0 && errno != EEXIST) {
    throw std::runtime_error(fifo + ": cannot be made: " + std::strerror(errno));
  }
  // For writing too: else it would be at its end whenever no one writes.
  const int fd = ::open(fifo.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) throw std::runtime_error(fifo + ": cannot be opened: " + std::strerror(errno));
  return driver::pci::FileDescriptor(fd);
}

void say(const std::string& text) {
  fmt::print("{}\n", text);
  std::fflush(stdout);
}

void obey(app::EmulatedCard& card, const std::string& line) {
  try {
    say(line + ": " + card.obey(line));
  } catch (const std::exception& error) {
    say(line + ": error: " + error.what());
  }
}

void take_commands(int fd, std::string& pending, app::EmulatedCard& card) {
  std::array<char, 512> buffer{};
  const ssize_t got = ::read(fd, buffer.data(), buffer.size());
  if (got > 0) pending.append(buffer.data(), static_cast<std::size_t>(got));
  for (std::size_t end = pending.find('\n'); end != std::string::npos; end = pending.find('\n')) {
    obey(card, pending.substr(0, end));
    pending.erase(0, end + 1);
  }
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

/// As quick to answer as a card would be, if permitted: an emulator waits for its turn, a card never does.
void take_priority(const Arguments& a) {
  if (a.priority == 0 || a.emulator.lock_step) return;
  sched_param wanted{};
  wanted.sched_priority = a.priority;
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0 || sched_setscheduler(0, SCHED_FIFO, &wanted) != 0) {
    say(std::string("not in real time (") + std::strerror(errno) +
        "): slow answers are to be expected; see abs_hil doctor, or --priority 0");
  }
}

int serve(Arguments& a) {
  read_plant(a);
  app::EmulatedCard card(a.emulator);
  for (const std::string& fault : a.faults) static_cast<void>(card.obey("fault " + fault));
  for (const std::string& command : a.commands) static_cast<void>(card.obey(command));
  pin_to(a.cpu);
  take_priority(a);
  std::filesystem::create_directories(a.pci_root);
  app::FuseTree tree(a.pci_root, a.bdfs, files_of(a), card);
  const driver::pci::FileDescriptor control = open_control(a.control_fifo);
  say("ready: card " + a.bdfs.front() + " in " + a.pci_root);

  // Accesses catch up with the clock by themselves; between them the rig goes on every ms, in steps of 100 us.
  constexpr timespec idle{.tv_sec = 0, .tv_nsec = 1'000'000};
  std::string pending;
  bool serving = true;
  while (serving && !stop_requested) {
    std::array<pollfd, 2> ready{{{tree.descriptor(), POLLIN, 0}, {control.get(), POLLIN, 0}}};
    static_cast<void>(::ppoll(ready.data(), ready.size(), &idle, nullptr));
    if (ready[0].revents != 0) serving = tree.serve_one();
    if (ready[1].revents != 0) take_commands(control.get(), pending, card);
    card.catch_up();
  }
  say("ended: " + card.status());
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  struct sigaction action {};
  action.sa_handler = [](int) { stop_requested = true; };
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaction(signal, &action, nullptr);
  CLI::App cli{"The ABS rig behind an emulated RT-DAC4/PCI card, as a tree of files like sysfs'"};
  Arguments arguments;
  add_options(cli, arguments);
  try {
    cli.parse(argc, argv);
    return serve(arguments);
  } catch (const CLI::ParseError& error) {
    return error.get_exit_code() == 0 ? cli.exit(error) : (cli.exit(error), 2);
  } catch (const settings::ConfigError& error) {
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
