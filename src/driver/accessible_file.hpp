#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <filesystem>

namespace abs_hil::driver {

/// True if this process may open the file for reading and writing. Opening a resource file or a device node accesses no
/// register.
[[nodiscard]] inline bool can_be_opened(const std::filesystem::path& file) noexcept {
  const int descriptor = ::open(file.c_str(), O_RDWR | O_CLOEXEC | O_NONBLOCK);
  if (descriptor >= 0) ::close(descriptor);
  return descriptor >= 0;
}

}  // namespace abs_hil::driver
