#pragma once

#include <functional>
#include <string>

namespace abs_hil::program {

/// A line of output, seen at once by who waits for it.
void say(const std::string& text);

/// FIFO that commands are taken from while the emulator runs. Without a path there is none.
class ControlFifo {
 public:
  /// Makes the FIFO if it is not there. Throws std::runtime_error.
  explicit ControlFifo(const std::string& path);
  ControlFifo(const ControlFifo&) = delete;
  ControlFifo& operator=(const ControlFifo&) = delete;
  ~ControlFifo();

  /// To wait on; -1: none.
  [[nodiscard]] int descriptor() const noexcept { return descriptor_; }
  /// Carries out the whole lines that have come, and says each one's answer or error.
  using Obey = std::function<std::string(const std::string& line)>;
  void take(const Obey& obey);

 private:
  int descriptor_{-1};
  std::string pending_{};
};

}  // namespace abs_hil::program
