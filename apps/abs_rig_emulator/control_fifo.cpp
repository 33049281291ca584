#include "control_fifo.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace abs_hil::program {

void say(const std::string& text) {
  fmt::print("{}\n", text);
  std::fflush(stdout);
}

ControlFifo::ControlFifo(const std::string& path) {
  if (path.empty()) return;
  if (::mkfifo(path.c_str(), 0600) != 0 && errno != EEXIST) {
    throw std::runtime_error(path + ": cannot create the FIFO: " + std::strerror(errno));
  }
  // Open it for writing, too: otherwise it reports end of file whenever it has no writer.
  descriptor_ = ::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  if (descriptor_ < 0) throw std::runtime_error(path + ": cannot open the FIFO: " + std::strerror(errno));
}

ControlFifo::~ControlFifo() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

void ControlFifo::take(const Obey& obey) {
  std::array<char, 512> buffer{};
  const ssize_t got = ::read(descriptor_, buffer.data(), buffer.size());
  if (got > 0) pending_.append(buffer.data(), static_cast<std::size_t>(got));
  for (std::size_t end = pending_.find('\n'); end != std::string::npos; end = pending_.find('\n')) {
    const std::string line = pending_.substr(0, end);
    pending_.erase(0, end + 1);
    try {
      say(line + ": " + obey(line));
    } catch (const std::exception& error) {
      say(line + ": error: " + error.what());
    }
  }
}

}  // namespace abs_hil::program
