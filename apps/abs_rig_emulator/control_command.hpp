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
  /// True if it has this name and number of arguments.
  [[nodiscard]] bool is(std::string_view name, std::size_t arguments) const;
  [[nodiscard]] const std::string& name() const { return words_.at(0); }
  /// The nth argument, from 1.
  [[nodiscard]] const std::string& text(std::size_t n) const { return words_.at(n); }
  /// The nth argument as a number. Throws std::invalid_argument if it is not one.
  [[nodiscard]] double number(std::size_t n) const;
  /// The nth argument as "on" or "off". Throws std::invalid_argument if it is neither.
  [[nodiscard]] bool on(std::size_t n) const;

  /// Throws std::invalid_argument with the line and the known commands.
  [[noreturn]] void refuse(const char* known) const;

 private:
  std::string line_;
  std::vector<std::string> words_{};
};

/// Obeys the commands of every board with supply and temperature sensors; false for any other command.
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

/// Obeys "turn upper|lower REVOLUTIONS"; false for any other command.
template <typename Board>
bool obey_turn(Board& board, const ControlCommand& command) {
  if (!command.is("turn", 2) || (command.text(1) != "upper" && command.text(1) != "lower")) return false;
  board.turn_by_hand(command.text(1) == "upper", command.number(2));
  return true;
}

}  // namespace abs_hil::program
