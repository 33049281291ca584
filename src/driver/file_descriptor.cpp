#include "driver/file_descriptor.hpp"

#include <unistd.h>

namespace abs_hil::driver {

FileDescriptor::~FileDescriptor() {
  if (fd_ >= 0) ::close(fd_);
}

}  // namespace abs_hil::driver
