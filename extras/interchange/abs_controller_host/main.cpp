// Runs a controller from a file for abs_hil, which starts it (docs/interchange.md).

#include <fcntl.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string_view>

#include "interchange/confinement.hpp"
#include "version/build_facts.hpp"

namespace {
std::uint64_t allocations = 0;
}  // namespace

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) && defined(__GLIBC__)
// Counts what the code of the file allocates.
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);

void* malloc(std::size_t size) {
  ++allocations;
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  ++allocations;
  return __libc_calloc(count, size);
}
void* realloc(void* block, std::size_t size) {
  ++allocations;
  return __libc_realloc(block, size);
}
}
#endif

int main(int argc, char** argv) {
  if (argc == 2 && argv[1] == std::string_view("--version")) {
    return std::puts(abs_hil::version::version_line("abs_controller_host").c_str()) < 0 ? 1 : 0;
  }
  if (::fcntl(abs_hil::interchange::host_socket, F_GETFD) < 0) {
    std::fputs("abs_controller_host: abs_hil starts this program by itself, for --controller FILE\n", stderr);
    return 2;
  }
  return abs_hil::interchange::run_host(abs_hil::interchange::load_here, [] { return allocations; });
}
