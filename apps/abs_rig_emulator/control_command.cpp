#include "control_command.hpp"

#include <charconv>
#include <stdexcept>
#include <utility>

namespace abs_hil::program {

ControlCommand::ControlCommand(std::string_view line) : line_(line) {
  std::string word;
  for (const char c : line_ + ' ') {
    if (c != ' ' && c != '\t' && c != '\r') {
      word += c;
    } else if (!word.empty()) {
      words_.push_back(std::exchange(word, {}));
    }
  }
}

bool ControlCommand::is(std::string_view name, std::size_t arguments) const {
  return words_.size() == arguments + 1 && words_[0] == name;
}

double ControlCommand::number(std::size_t n) const {
  const std::string& word = text(n);
  double value = 0.0;
  const auto [at, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || at != word.data() + word.size()) {
    throw std::invalid_argument("\"" + word + "\" is not a number");
  }
  return value;
}

bool ControlCommand::on(std::size_t n) const {
  const std::string& word = text(n);
  if (word != "on" && word != "off") throw std::invalid_argument("\"" + word + "\": give on or off");
  return word == "on";
}

void ControlCommand::refuse(const char* known) const {
  throw std::invalid_argument("unknown command \"" + line_ + "\"; known are\n" + known);
}

}  // namespace abs_hil::program
