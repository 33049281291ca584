#pragma once

#include <functional>
#include <string>

namespace abs_hil::program {

/// Prints a line and flushes it.
void say(const std::string& text);

/// FIFO from which the emulator takes commands while it runs. An empty path means no FIFO.
class ControlFifo {
 public:
  /// Creates the FIFO if it does not exist. Throws std::runtime_error.
  explicit ControlFifo(const std::string& path);
  ControlFifo(const ControlFifo&) = delete;
  ControlFifo& operator=(const ControlFifo&) = delete;
  ~ControlFifo();

  /// Descriptor for poll(); -1: no FIFO.
  [[nodiscard]] int descriptor() const noexcept { return descriptor_; }
  /// Obeys all complete lines received, and prints the answer or error of each.
  using Obey = std::function<std::string(const std::string& line)>;
  void take(const Obey& obey);

 private:
  int descriptor_{-1};
  std::string pending_{};
};

}  // namespace abs_hil::program
