#include "guardian/shared_region.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <new>
#include <span>
#include <stdexcept>
#include <system_error>

namespace abs_hil::guardian {

namespace {

constexpr std::uint64_t region_magic = 0x6E61'6964'7261'7567;  // "guardian"

[[noreturn]] void fail(const char* what) {
  throw std::system_error(errno, std::generic_category(), std::string("guardian: shared memory: ") + what);
}

}  // namespace

std::size_t SharedRegion::bytes_for(std::size_t slots) noexcept {
  return sizeof(Header) + slots * sizeof(runtime::FlightSlot);
}

std::uint64_t SharedRegion::expected_layout() noexcept {
  return std::uint64_t{sizeof(Header)} << 32U | sizeof(runtime::FlightSlot);
}

runtime::FlightSlot* SharedRegion::first_slot() const noexcept {
  return reinterpret_cast<runtime::FlightSlot*>(header_ + 1);
}

void SharedRegion::map(std::size_t bytes) {
  // MAP_POPULATE: the cycle's first lap around the recorder must not cause page faults.
  void* const memory = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, fd_, 0);
  if (memory == MAP_FAILED) fail("cannot be mapped");
  bytes_ = bytes;
  header_ = static_cast<Header*>(memory);
}

SharedRegion::SharedRegion(std::size_t slots) : fd_(::memfd_create("abs_hil run", MFD_CLOEXEC | MFD_ALLOW_SEALING)) {
  if (fd_ < 0) fail("cannot be made");
  const std::size_t bytes = bytes_for(slots);
  // Sealed: neither process can shrink the memory that the other one uses.
  if (::ftruncate(fd_, static_cast<off_t>(bytes)) != 0 ||
      ::fcntl(fd_, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL) != 0) {
    const int error = errno;
    ::close(fd_);
    errno = error;
    fail("cannot be sized");
  }
  map(bytes);
  new (header_) Header{.magic = region_magic, .layout = expected_layout(), .slots = slots};
  for (std::size_t i = 0; i < slots; ++i) new (first_slot() + i) runtime::FlightSlot;
  recorder_ = runtime::FlightRing({first_slot(), slots});
}

SharedRegion::SharedRegion(Inherited inherited) : fd_(inherited.fd), owns_fd_(false) {
  struct stat status {};
  if (::fstat(fd_, &status) != 0) fail("no such descriptor");
  const auto bytes = static_cast<std::size_t>(status.st_size);
  const int seals = ::fcntl(fd_, F_GET_SEALS);
  if (bytes < sizeof(Header) || seals < 0 || (seals & F_SEAL_SHRINK) == 0) {
    throw std::runtime_error("guardian: the descriptor given is not the shared memory of a run");
  }
  map(bytes);
  if (header_->magic != region_magic || header_->layout != expected_layout() || header_->slots == 0 ||
      bytes != bytes_for(header_->slots)) {
    ::munmap(header_, bytes_);
    throw std::runtime_error(
        "guardian: the shared memory comes from another build of abs_hil; install abs_hil and abs_guardian of one "
        "build");
  }
  recorder_ = runtime::FlightRing({first_slot(), header_->slots});
}

SharedRegion::~SharedRegion() {
  if (header_ != nullptr) ::munmap(header_, bytes_);
  if (owns_fd_ && fd_ >= 0) ::close(fd_);
}

}  // namespace abs_hil::guardian
