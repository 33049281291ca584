#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace abs_hil::program {

/// One line of control: a name and its arguments.
class ControlCommand {
 public:
  explicit ControlCommand(std::string_view line);

  [[nodiscard]] bool empty() const noexcept { return words_.empty(); }
  /// Whether it has this name and so many arguments.
  [[nodiscard]] bool is(std::string_view name, std::size_t arguments) const;
  [[nodiscard]] const std::string& name() const { return words_.at(0); }
  /// The nth argument, from 1.
  [[nodiscard]] const std::string& text(std::size_t n) const { return words_.at(n); }
  /// Throws std::invalid_argument if it is no number.
  [[nodiscard]] double number(std::size_t n) const;
  /// Throws std::invalid_argument if it is neither "on" nor "off".
  [[nodiscard]] bool on(std::size_t n) const;

  /// Throws std::invalid_argument that names the line and the commands that there are.
  [[noreturn]] void refuse(const char* known) const;

 private:
  std::string line_;
  std::vector<std::string> words_{};
};

/// Obeys what every board with supply and temperature sensors knows; false: the command is none of these.
template <typename Board>
bool obey_surroundings(Board& board, const ControlCommand& command) {
  if (command.is("estop", 1)) {
    board.press_emergency_stop(command.on(1));
  } else if (command.is("supply", 1)) {
    board.set_supply_V(command.number(1));
  } else if (command.is("temperature", 1)) {
    board.set_temperature_C(command.number(1));
  } else if (command.is("overspeed", 0)) {
    board.trip_overspeed();
  } else {
    return false;
  }
  return true;
}

/// Obeys "turn upper|lower REVOLUTIONS"; false: the command is another.
template <typename Board>
bool obey_turn(Board& board, const ControlCommand& command) {
  if (!command.is("turn", 2) || (command.text(1) != "upper" && command.text(1) != "lower")) return false;
  board.turn_by_hand(command.text(1) == "upper", command.number(2));
  return true;
}

}  // namespace abs_hil::program
