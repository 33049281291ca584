#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>

#include "driver/file_descriptor.hpp"
#include "runtime/heartbeat.hpp"

namespace abs_hil::guardian {

using runtime::GuardPage;
using runtime::RunPage;
using runtime::Stage;

/// Memory that two processes share through a descriptor. It is sealed: neither can shrink it under the other.
class SharedMemory {
 public:
  enum class Access : std::uint8_t { read, write };

  /// New memory of zeros. Throws std::system_error.
  explicit SharedMemory(std::size_t bytes);
  /// Maps what stands behind a descriptor, which the caller keeps. Throws std::runtime_error unless it is sealed memory
  /// of exactly `bytes` bytes: its sender cannot make this process map more.
  SharedMemory(int fd, std::size_t bytes, Access access);

  /// From now on nobody can map it for writing; mappings that exist stay writable. False if the kernel cannot do it.
  [[nodiscard]] bool refuse_further_writers() const noexcept;
  /// From now on this process can only read it here. False if the kernel cannot do it.
  [[nodiscard]] bool make_read_only() const noexcept;
  [[nodiscard]] int descriptor() const noexcept { return fd_.get(); }
  [[nodiscard]] void* data() const noexcept { return memory_.get(); }

 private:
  struct Unmap {
    std::size_t bytes;
    void operator()(void* memory) const noexcept { ::munmap(memory, bytes); }
  };
  void map(int fd, std::size_t bytes, Access access);

  driver::FileDescriptor fd_;  ///< of memory that this object made
  std::unique_ptr<void, Unmap> memory_;
};

/// The pages of one run and its guard. Each side writes one of them.
class Pages {
 public:
  /// Makes both. Throws std::system_error.
  Pages();
  struct Descriptors {
    int run{-1};
    int guard{-1};
  };
  /// Maps the pages of another process as the guard (it writes the guard's page) or as the run. Throws
  /// std::runtime_error.
  [[nodiscard]] static Pages as_guard(const Descriptors& pages);
  [[nodiscard]] static Pages as_run(const Descriptors& pages);

  [[nodiscard]] RunPage& run() const noexcept { return *static_cast<RunPage*>(run_.data()); }
  [[nodiscard]] GuardPage& guard() const noexcept { return *static_cast<GuardPage*>(guard_.data()); }
  /// Of pages that this object made.
  [[nodiscard]] Descriptors descriptors() const noexcept { return {run_.descriptor(), guard_.descriptor()}; }
  [[nodiscard]] bool refuse_further_writers() const noexcept { return guard_.refuse_further_writers(); }
  /// A run that made the pages itself gives up writing the guard's: no stray pointer can forge its guardian's beats.
  [[nodiscard]] bool leave_guard_page() const noexcept { return guard_.make_read_only(); }

 private:
  Pages(SharedMemory run, SharedMemory guard) : run_(std::move(run)), guard_(std::move(guard)) {}

  SharedMemory run_;
  SharedMemory guard_;
};

/// The flight recorder's memory. The run writes it; its guardian reads it after a fault.
class SharedRecorder {
 public:
  /// The longest recorder that a guardian maps, bytes.
  static constexpr std::size_t most_bytes = std::size_t{64} << 20U;

  /// Throws std::system_error. @param slots  >= 1
  explicit SharedRecorder(std::size_t slots);
  /// Maps the recorder of another process for reading; the caller keeps the descriptor. Throws std::runtime_error if
  /// there is none behind it, or one of another build.
  [[nodiscard]] static SharedRecorder attach(int fd);

  [[nodiscard]] int descriptor() const noexcept { return memory_.descriptor(); }
  [[nodiscard]] runtime::FlightRing& ring() noexcept { return ring_; }
  [[nodiscard]] const runtime::FlightRing& ring() const noexcept { return ring_; }

 private:
  struct Header {
    std::uint64_t magic{0};
    std::uint64_t layout{0};  ///< sizes of all shared types; builds with different sizes do not fit together
    std::uint64_t slots{0};
  };
  SharedRecorder(SharedMemory memory, std::size_t slots);
  [[nodiscard]] static std::size_t bytes_for(std::size_t slots) noexcept;

  SharedMemory memory_;
  runtime::FlightRing ring_{{}};
};

}  // namespace abs_hil::guardian
