#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <filesystem>
#include <utility>

namespace abs_hil::driver {

/// An open file that closes itself.
class FileDescriptor {
 public:
  explicit FileDescriptor(int fd = -1) noexcept : fd_(fd) {}
  FileDescriptor(FileDescriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  FileDescriptor& operator=(FileDescriptor&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  ~FileDescriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  [[nodiscard]] int get() const noexcept { return fd_; }

 private:
  int fd_;
};

/// True if this process may open the file for reading and writing. Opening a resource file or a device node accesses no
/// register.
[[nodiscard]] inline bool can_be_opened(const std::filesystem::path& file) noexcept {
  return FileDescriptor(::open(file.c_str(), O_RDWR | O_CLOEXEC | O_NONBLOCK)).get() >= 0;
}

}  // namespace abs_hil::driver
