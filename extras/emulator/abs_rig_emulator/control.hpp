// What the emulated boards share: the main loop's view of them, their control commands, the log of true values.

#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "cli/command_line.hpp"
#include "driver/file_descriptor.hpp"
#include "driver/monotonic_time.hpp"
#include "emulator/rig_behind.hpp"
#include "emulator/usbip_device.hpp"

namespace abs_hil::program {

/// What the command line says.
struct EmulatorOptions {
  emulator::BoardOptions board{.name = ""};  ///< an empty name means the usual one
  emulator::UsbIdentity identity{};
  std::vector<std::string> when_braking{};  ///< commands of the USB board, obeyed once the brake has acted for 0.3 s
  std::string plant{"paper-table1"};
  std::vector<std::string> assignments{};
  std::vector<std::string> faults{};
  std::vector<std::string> commands{};
  std::uint64_t seed{1};
  std::string control_fifo{};
  std::string truth_file{};    ///< CSV of true values that no register or frame shows; empty: none
  std::string traffic_file{};  ///< log of every register access to the card; empty: none
  int cpu{-1};
  int priority{81};
  // Where the board is.
  std::string pci_root{};
  std::string can_interface{};
  bool use_usb{false};
  std::string controller{"/sys/devices/platform/vhci_hcd.0"};  ///< the kernel's virtual host controller
  std::string hm2_address{};                                   ///< ADDRESS or ADDRESS:PORT, of a 7I92T
  std::string node_address{};                                  ///< the same of the node of docs/node.md
  std::string mac{};                                           ///< "00:60:1b:16:ab:50"; empty: the default
  std::vector<std::string> wrong_words{};                      ///< "0x458=0x01010204", of the 7I92T's description
  // What the card's folder shows.
  std::vector<std::string> bdfs{"0000:03:00.0"};
  std::string vendor{"0x10b5"};
  std::string device{"0x2497"};
  std::uint32_t bar_bytes{256};
  std::string bar_kind{"io"};
};

/// A board with time, faults, logs and control commands, as the main loop sees it.
class EmulatedBoard {
 public:
  virtual ~EmulatedBoard() = default;

  /// Descriptor for poll().
  [[nodiscard]] virtual int descriptor() const = 0;
  /// Answers what has come from the host. False: the host has gone for good.
  virtual bool serve() = 0;
  /// Advances the rig to the current time, in lock-step only the host does, and sends the answers that are due.
  virtual void catch_up() = 0;
  /// Time in ns until the next delayed answer; none: there is no such answer.
  [[nodiscard]] virtual std::optional<std::int64_t> next_due_ns() const { return std::nullopt; }
  /// Obeys one control command and returns its answer. Throws std::invalid_argument for an unknown command.
  virtual std::string obey(std::string_view line) = 0;
  /// Current duties at the power stage and other values, as one line.
  [[nodiscard]] virtual std::string status() const = 0;
  [[nodiscard]] virtual std::string place() const = 0;
};

/// Prints a line and flushes it.
void say(const std::string& text);

/// One line of control: a name and its arguments.
struct ControlCommand {
  explicit ControlCommand(std::string_view text);

  std::string line;
  std::vector<std::string> words{};

  /// The nth argument, from 1.
  [[nodiscard]] const std::string& text(std::size_t n) const { return words.at(n); }
  /// The nth argument as a finite number. Throws std::invalid_argument if it is not one.
  [[nodiscard]] double number(std::size_t n) const;
  /// True if the nth argument is the first of these words, false if it is the second. Throws std::invalid_argument if
  /// it is neither.
  [[nodiscard]] bool first_of(std::size_t n, std::string_view first, std::string_view second) const;
  [[nodiscard]] bool on(std::size_t n) const { return first_of(n, "on", "off"); }
};

/// A command that a board obeys. Its usage begins with its name, then come its arguments.
template <class Board>
struct ControlRow {
  std::string_view usage;
  std::string_view meaning;
  void (*obey)(Board&, const ControlCommand&){nullptr};  ///< null: it only answers
  bool any_arguments{false};
  std::string (Board::*answer)() const {&Board::status};

  [[nodiscard]] bool is(const ControlCommand& command) const {
    const auto words = static_cast<std::size_t>(std::ranges::count(usage, ' ')) + 1;
    return command.words.at(0) == usage.substr(0, usage.find(' ')) && (any_arguments || command.words.size() == words);
  }
};

/// Rows that several boards have. `model` of such a board is its emulator.
template <class Board>
constexpr ControlRow<Board> estop_row{
    "estop on|off", "the emergency stop: cuts the drive only",
    [](Board& b, const ControlCommand& c) { b.model().press_emergency_stop(c.on(1)); }};
template <class Board>
constexpr ControlRow<Board> supply_row{"supply V", "what the board measures",
                                       [](Board& b, const ControlCommand& c) { b.model().set_supply_V(c.number(1)); }};
template <class Board>
constexpr ControlRow<Board> temperature_row{
    "temperature C", "what the board measures",
    [](Board& b, const ControlCommand& c) { b.model().set_temperature_C(c.number(1)); }};
template <class Board>
constexpr ControlRow<Board> overspeed_row{"overspeed", "latches the overspeed interlock until the wheels stop",
                                          [](Board& b, const ControlCommand&) { b.model().trip_overspeed(); }};
template <class Board>
constexpr ControlRow<Board> turn_row{"turn upper|lower REVOLUTIONS", "a wheel is turned by hand",
                                     [](Board& b, const ControlCommand& c) {
                                       constexpr double most = 100.0;
                                       const bool upper = c.first_of(1, "upper", "lower");
                                       if (std::abs(c.number(2)) > most)
                                         throw std::invalid_argument(c.text(2) + ": give -100 to 100 revolutions");
                                       b.model().turn_by_hand(upper, c.number(2));
                                     }};

/// FIFO from which the emulator takes commands while it runs. An empty path means no FIFO.
class ControlFifo {
 public:
  /// Creates the FIFO if it does not exist. Throws std::runtime_error.
  explicit ControlFifo(const std::string& path);

  /// Descriptor for poll(); -1: no FIFO.
  [[nodiscard]] int descriptor() const noexcept { return fifo_.get(); }
  /// Lets the board obey all complete lines received, and prints the answer or error of each.
  void take(EmulatedBoard& board);

 private:
  driver::FileDescriptor fifo_{};
  std::string pending_{};
};

/// An output file of the emulator. What a full disk loses is told when it is closed.
class OutputFile : public std::ofstream {
 public:
  OutputFile() = default;
  ~OutputFile() override { end(); }
  /// "off" closes it. Throws std::runtime_error.
  void begin(const std::string& file);
  /// True if any file has lost what was written.
  [[nodiscard]] static bool any_lost() noexcept { return any_lost_; }

 private:
  void end();
  inline static bool any_lost_{false};
  std::string name_{};
};

/// A board's time, and the CSV of true values that it does not show to the host, one row per ms of that time.
class BoardTime {
 public:
  /// `with_trip_flags`: adds a last column, for boards that have them. Throws std::runtime_error.
  explicit BoardTime(const EmulatorOptions& options, bool with_trip_flags = false);

  /// What the board's time begins at: 0 in lock-step, otherwise a time of this computer, ns.
  [[nodiscard]] std::int64_t start_ns() const noexcept { return started_ns_; }
  /// Begins anew at power-on.
  void restart() noexcept {
    started_ns_ = lock_step_ ? 0 : driver::monotonic_ns();
    seen_ns_ = 0;
  }
  /// Advances the board to this computer's time; in lock-step only the host advances it.
  template <typename Board>
  void catch_up(Board& board) {
    if (lock_step_) return;
    const std::int64_t now_ns = driver::monotonic_ns() - started_ns_;
    const std::int64_t unseen_ns = now_ns - std::exchange(seen_ns_, now_ns);
    // The emulator looks every ms (main.cpp). After more than two the computer has paused it.
    if (unseen_ns > 2 * period_ns) board.stood_still(unseen_ns - period_ns);
    advance(board, now_ns);
  }
  /// Advances the board to `time_ns` and writes every row that is due in between.
  template <typename Board>
  void advance(Board& board, std::int64_t time_ns) {
    while (stream_.is_open() && next_ns_ <= time_ns) {
      board.advance_to(next_ns_);
      write(board.time_ns(), board.plant().truth(), board.outputs());
      if constexpr (requires { board.trip_flags(); }) stream_ << ',' << board.trip_flags();
      stream_ << '\n';
      next_ns_ += period_ns;
    }
    board.advance_to(time_ns);
  }

 private:
  static constexpr std::int64_t period_ns = 1'000'000;
  void write(std::int64_t time_ns, const rig::PlantTruth& truth, const emulator::Outputs& out);

  bool lock_step_;
  std::int64_t started_ns_{0};
  std::int64_t seen_ns_{0};  ///< the board's time at the last look
  OutputFile stream_{};
  std::int64_t next_ns_{0};
};

/// Prints the events of a log, and writes the changes to a file if it is open.
/// @param start_ns  what the board's time begins at
void take_log(emulator::OutputLog& log, std::int64_t start_ns, OutputFile& changes);

/// "time 1.234 s, drive 0.5000, brake 0.0000, upper 12.30 rad/s, lower 12.40 rad/s"
[[nodiscard]] std::string state_text(const emulator::RigBehind& rig, int digits_of_time = 3);

/// What every board does in the same way. `Board` has the rows() of its commands, and model(), its emulator.
template <class Board>
class BoardOf : public EmulatedBoard {
 public:
  explicit BoardOf(const EmulatorOptions& options, bool with_trip_flags = false) : time_(options, with_trip_flags) {}

  void catch_up() override {
    time_.catch_up(self().model());
    log_events();
  }
  std::string obey(std::string_view line) override {
    catch_up();
    const ControlCommand command(line);
    if (command.words.empty()) return {};
    if (command.words == std::vector<std::string>{"status"}) return status();
    for (const ControlRow<Board>& row : Board::rows()) {
      if (!row.is(command)) continue;
      if (row.obey != nullptr) row.obey(self(), command);
      log_events();
      return (self().*row.answer)();
    }
    throw std::invalid_argument("unknown command \"" + command.line + "\"; known are\n" + commands());
  }
  /// Its control commands, one per line, for the help.
  [[nodiscard]] static std::string commands() {
    std::string text;
    const auto add = [&text](auto usage, auto meaning) { text += fmt::format("{:<31} {}\n", usage, meaning); };
    for (const ControlRow<Board>& row : Board::rows()) add(row.usage, row.meaning);
    add("status", "duties on the wire, speeds, and what the board tells");
    return text;
  }

 protected:
  /// Prints the events that the board has logged, and writes the changes of its outputs to an open file.
  void log_events() { take_log(self().model().log(), time_.start_ns(), changes_); }

  BoardTime time_;
  OutputFile changes_{};

 private:
  [[nodiscard]] Board& self() noexcept { return static_cast<Board&>(*this); }
};

/// A kind of board. `make` throws std::invalid_argument, or std::runtime_error if what it needs of this computer is
/// missing: a FUSE mount, a bus or socket, a virtual host controller, an address.
struct BoardKind {
  std::string_view name;
  std::string commands;
  std::unique_ptr<EmulatedBoard> (*make)(const EmulatorOptions& options);
};
template <class Board>
[[nodiscard]] BoardKind kind_of(std::string_view name) {
  return {name, Board::commands(), [](const EmulatorOptions& options) -> std::unique_ptr<EmulatedBoard> {
            return std::make_unique<Board>(options);
          }};
}
[[nodiscard]] BoardKind card_kind();
[[nodiscard]] BoardKind can_node_kind();
[[nodiscard]] BoardKind usb_kind();
/// The 7I92T, or the node if `node_address` is not empty.
[[nodiscard]] BoardKind hm2_kind();

}  // namespace abs_hil::program
