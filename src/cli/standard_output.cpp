// Tells of results that standard output has lost.
#include "cli/standard_output.hpp"

#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

namespace abs_hil::cli {

int with_stdout(const char* program, int status) {
  errno = 0;
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return status;
  const int why = errno;
  pollfd output{STDOUT_FILENO, POLLOUT, 0};
  if (::poll(&output, 1, 0) > 0 && (output.revents & (POLLERR | POLLHUP)) != 0) return status;
  std::fprintf(stderr, "%s: cannot write to standard output%s%s\n", program, why != 0 ? ": " : "",
               why != 0 ? std::strerror(why) : "");
  return status == 0 ? 1 : status;
}

}  // namespace abs_hil::cli
