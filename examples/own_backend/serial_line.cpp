// Lines of text to and from the board, over a port of the kernel.
#include "serial_line.hpp"

#include <fcntl.h>
#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <string_view>
#include <system_error>
#include <utility>

namespace serial_board {

namespace {

std::int64_t now_ms() noexcept {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<std::int64_t>(now.tv_sec) * 1000 + now.tv_nsec / 1'000'000;
}

}  // namespace

SerialLine::SerialLine(const std::string& port)
    : fd_(::open(port.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK)) {
  if (fd_ < 0) throw std::system_error(errno, std::generic_category(), port);
  termios raw{};
  if (::tcgetattr(fd_, &raw) != 0) return;  // no terminal: a pty's peer, a socket
  ::cfmakeraw(&raw);
  ::cfsetspeed(&raw, B1000000);
  raw.c_cflag |= CLOCAL;
  ::tcsetattr(fd_, TCSANOW, &raw);
}

SerialLine::SerialLine(SerialLine&& other) noexcept { *this = std::move(other); }

SerialLine& SerialLine::operator=(SerialLine&& other) noexcept {
  std::swap(fd_, other.fd_);
  held_ = line_ = 0;
  return *this;
}

SerialLine::~SerialLine() {
  if (fd_ >= 0) ::close(fd_);
}

void SerialLine::drain() noexcept {
  held_ = line_ = 0;
  ::tcflush(fd_, TCIFLUSH);
}

LineError SerialLine::send(const char* text, std::size_t size) noexcept {
  const ssize_t sent = ::write(fd_, text, size);
  if (sent == static_cast<ssize_t>(size)) return LineError::none;
  return sent < 0 && errno != EAGAIN && errno != EINTR ? LineError::gone : LineError::silent;
}

LineError SerialLine::receive(std::string_view& line, int timeout_ms) noexcept {
  std::memmove(text_.data(), text_.data() + line_, held_ - line_);
  held_ -= std::exchange(line_, 0);
  const std::int64_t end_ms = now_ms() + timeout_ms;
  for (;;) {
    const char* end = std::find(text_.data(), text_.data() + held_, '\n');
    if (end != text_.data() + held_) {
      line = {text_.data(), static_cast<std::size_t>(end - text_.data())};
      line_ = line.size() + 1;
      return LineError::none;
    }
    if (held_ == text_.size()) {
      held_ = 0;
      return LineError::garbled;
    }
    pollfd readable{fd_, POLLIN, 0};
    const int ready = ::poll(&readable, 1, static_cast<int>(std::max<std::int64_t>(0, end_ms - now_ms())));
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0) return LineError::silent;
    const ssize_t got = ::read(fd_, text_.data() + held_, text_.size() - held_);
    if (got > 0) held_ += static_cast<std::size_t>(got);
    if (got == 0 || (got < 0 && errno != EAGAIN && errno != EINTR)) return LineError::gone;
  }
}

LineError SerialLine::take_state(State& state, int timeout_ms) noexcept {
  std::string_view line;
  if (const LineError error = receive(line, timeout_ms); error != LineError::none) return error;
  std::array<char, 128> text{};
  std::copy(line.begin(), line.end(), text.begin());
  State taken;
  const int fields = std::sscanf(text.data(), "s %d %d %u %u", &taken.upper_counts, &taken.lower_counts,
                                 &taken.drive_width, &taken.brake_width);
  if (fields != 4) return LineError::garbled;
  state = taken;
  return LineError::none;
}

LineError SerialLine::ask_state(State& state, int timeout_ms) noexcept {
  if (const LineError error = send("r\n", 2); error != LineError::none) return error;
  return take_state(state, timeout_ms);
}

LineError SerialLine::set_widths(std::uint32_t drive, std::uint32_t brake, State& state, int timeout_ms) noexcept {
  std::array<char, 32> text{};
  const int size = std::snprintf(text.data(), text.size(), "w %u %u\n", drive, brake);
  if (const LineError error = send(text.data(), static_cast<std::size_t>(size)); error != LineError::none) return error;
  return take_state(state, timeout_ms);
}

}  // namespace serial_board
