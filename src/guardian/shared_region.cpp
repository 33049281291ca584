// Makes, seals and maps the memory that two processes share.
#include "guardian/shared_region.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <new>
#include <stdexcept>
#include <string>
#include <system_error>

#ifndef F_SEAL_FUTURE_WRITE
#define F_SEAL_FUTURE_WRITE 0x0010  // Linux 5.1
#endif

namespace abs_hil::guardian {

namespace {

constexpr std::uint64_t recorder_magic = 0x6E61'6964'7261'7567;  // "guardian"
constexpr std::uint64_t layout = std::uint64_t{sizeof(RunPage)} << 48U | std::uint64_t{sizeof(GuardPage)} << 32U |
                                 std::uint64_t{sizeof(runtime::FlightSlot)};

[[noreturn]] void fail(const char* what) {
  throw std::system_error(errno, std::generic_category(), std::string("guardian: shared memory: ") + what);
}

/// Size of sealed memory behind a descriptor; 0 for anything else.
std::size_t sealed_bytes(int fd) noexcept {
  struct stat status {};
  const int seals = ::fcntl(fd, F_GET_SEALS);
  if (seals < 0 || (seals & F_SEAL_SHRINK) == 0 || ::fstat(fd, &status) != 0 || status.st_size <= 0) return 0;
  return static_cast<std::size_t>(status.st_size);
}

}  // namespace

SharedMemory::SharedMemory(std::size_t bytes) : fd_(::memfd_create("abs_hil run", MFD_CLOEXEC | MFD_ALLOW_SEALING)) {
  if (fd_.get() < 0) fail("cannot be made");
  if (::ftruncate(fd_.get(), static_cast<off_t>(bytes)) != 0 ||
      ::fcntl(fd_.get(), F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW) != 0) {
    fail("cannot be sized");
  }
  map(fd_.get(), bytes, Access::write);
}

SharedMemory::SharedMemory(int fd, std::size_t bytes, Access access) {
  if (sealed_bytes(fd) != bytes) {
    throw std::runtime_error(
        "guardian: the descriptor given is not the shared memory of a run of this build; install abs_hil and "
        "abs_guardian of one build");
  }
  map(fd, bytes, access);
}

void SharedMemory::map(int fd, std::size_t bytes, Access access) {
  const int protection = access == Access::write ? PROT_READ | PROT_WRITE : PROT_READ;
  // MAP_POPULATE: the cycle's first lap around the recorder must not cause page faults.
  void* const memory = ::mmap(nullptr, bytes, protection, MAP_SHARED | MAP_POPULATE, fd, 0);
  if (memory == MAP_FAILED) fail("cannot be mapped");
  memory_ = {memory, Unmap{bytes}};
}

bool SharedMemory::refuse_further_writers() const noexcept {
  return ::fcntl(fd_.get(), F_ADD_SEALS, F_SEAL_FUTURE_WRITE | F_SEAL_SEAL) == 0;
}

bool SharedMemory::make_read_only() const noexcept {
  return ::mprotect(memory_.get(), memory_.get_deleter().bytes, PROT_READ) == 0;
}

Pages::Pages() : run_(sizeof(RunPage)), guard_(sizeof(GuardPage)) {
  new (run_.data()) RunPage;
  new (guard_.data()) GuardPage;
}

Pages Pages::as_guard(const Descriptors& pages) {
  using Access = SharedMemory::Access;
  return {SharedMemory(pages.run, sizeof(RunPage), Access::read),
          SharedMemory(pages.guard, sizeof(GuardPage), Access::write)};
}

Pages Pages::as_run(const Descriptors& pages) {
  using Access = SharedMemory::Access;
  return {SharedMemory(pages.run, sizeof(RunPage), Access::write),
          SharedMemory(pages.guard, sizeof(GuardPage), Access::read)};
}

std::size_t SharedRecorder::bytes_for(std::size_t slots) noexcept {
  return sizeof(Header) + slots * sizeof(runtime::FlightSlot);
}

SharedRecorder::SharedRecorder(SharedMemory memory, std::size_t slots) : memory_(std::move(memory)) {
  auto* const first = reinterpret_cast<runtime::FlightSlot*>(static_cast<Header*>(memory_.data()) + 1);
  ring_ = runtime::FlightRing({first, slots});
}

SharedRecorder::SharedRecorder(std::size_t slots) : SharedRecorder(SharedMemory(bytes_for(slots)), slots) {
  auto* const header = new (memory_.data()) Header{.magic = recorder_magic, .layout = layout, .slots = slots};
  auto* const first = reinterpret_cast<runtime::FlightSlot*>(header + 1);
  for (std::size_t i = 0; i < slots; ++i) new (first + i) runtime::FlightSlot;
}

SharedRecorder SharedRecorder::attach(int fd) {
  const std::size_t bytes = sealed_bytes(fd);
  if (bytes < bytes_for(1) || bytes > most_bytes) {
    throw std::runtime_error("guardian: the descriptor given is not the flight recorder of a run");
  }
  SharedMemory memory(fd, bytes, SharedMemory::Access::read);
  // Read once: the other process may still write it.
  const Header header = *static_cast<const Header*>(memory.data());
  if (header.magic != recorder_magic || header.layout != layout || header.slots > most_bytes ||
      bytes != bytes_for(header.slots)) {
    throw std::runtime_error(
        "guardian: the flight recorder comes from another build of abs_hil; install abs_hil and abs_guardian of one "
        "build");
  }
  return {std::move(memory), header.slots};
}

}  // namespace abs_hil::guardian
