// A serial line with a text protocol: one line to the board, one line back.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

namespace serial_board {

/// What the board reports in each answer: "s UPPER LOWER DRIVE BRAKE".
struct State {
  std::int32_t upper_counts{0};
  std::int32_t lower_counts{0};
  std::uint32_t drive_width{0};
  std::uint32_t brake_width{0};
};

/// Errors of a line; `gone`: unplugged, or the peer of a pty has closed.
enum class LineError : std::uint8_t { none, silent, garbled, gone };

class SerialLine {
 public:
  SerialLine() = default;
  /// Opens the port, raw, without becoming its terminal. Throws std::system_error.
  explicit SerialLine(const std::string& port);
  SerialLine(SerialLine&& other) noexcept;
  SerialLine& operator=(SerialLine&& other) noexcept;
  ~SerialLine();

  [[nodiscard]] bool is_open() const noexcept { return fd_ >= 0; }
  /// Sends a line without waiting. Real-time safe.
  [[nodiscard]] LineError send(const char* text, std::size_t size) noexcept;
  /// Waits for a whole line, at most `timeout_ms`. Real-time safe but for the wait.
  [[nodiscard]] LineError receive(std::string_view& line, int timeout_ms) noexcept;
  /// Forgets what has come so far.
  void drain() noexcept;

  [[nodiscard]] LineError ask_state(State& state, int timeout_ms) noexcept;
  [[nodiscard]] LineError set_widths(std::uint32_t drive, std::uint32_t brake, State& state, int timeout_ms) noexcept;

 private:
  [[nodiscard]] LineError take_state(State& state, int timeout_ms) noexcept;

  int fd_{-1};
  std::array<char, 128> text_{};
  std::size_t held_{0};
  std::size_t line_{0};  ///< bytes of the line returned last
};

}  // namespace serial_board
