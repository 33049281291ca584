// Opens, locks, reads and writes the file of a card's registers.
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <bit>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <string>

#include "driver/pci/wire.hpp"
#include "driver/sysfs.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::driver::pci {

static_assert(std::endian::native == std::endian::little, "PCI registers and the kernel's files are little-endian");

namespace {

[[noreturn]] void refuse_file(const std::filesystem::path& file, const std::string& problem) {
  refuse(file.string() + ": " + problem);
}

int open_for_access(const std::filesystem::path& file) {
  const int fd = ::open(file.c_str(), O_RDWR | O_CLOEXEC);
  if (fd >= 0) return fd;
  const int error = errno;
  if (error == EACCES || error == EPERM) {
    refuse_file(file, std::string("permission denied (") + std::strerror(error) +
                          "): install config/udev/70-abs-hil.rules and join the group abs_hil (docs/rig-setup.md)");
  }
  refuse_file(file, "cannot be opened: " + rig::refusal(error, file, rig::reaching));
}

/// The process that holds the flock of an open file, from /proc/locks ("7: FLOCK ADVISORY WRITE 4711 00:3a:42 0 EOF").
std::string lock_holder(int fd) {
  struct stat status {};
  if (::fstat(fd, &status) != 0) return "another process";
  std::ifstream locks("/proc/locks");
  for (std::string line; std::getline(locks, line);) {
    long pid = 0;
    unsigned int major_number = 0;
    unsigned int minor_number = 0;
    unsigned long inode = 0;
    const char* at = std::strstr(line.c_str(), "FLOCK");
    if (at == nullptr ||
        std::sscanf(at, "FLOCK %*s %*s %ld %x:%x:%lu", &pid, &major_number, &minor_number, &inode) != 4) {
      continue;
    }
    if (inode != status.st_ino || makedev(major_number, minor_number) != status.st_dev) continue;
    const std::string name = process_name(pid);
    return "process " + std::to_string(pid) + (name.empty() ? "" : " (" + name + ")");
  }
  return "another process (find it with lsof)";
}

/// Process id of the guardian that holds an fcntl lock on the card; 0 if there is none, or if it is this process.
pid_t guardian_of(int fd) {
  struct flock lock {};
  lock.l_type = F_WRLCK;
  lock.l_whence = SEEK_SET;
  return ::fcntl(fd, F_GETLK, &lock) == 0 && lock.l_type != F_UNLCK ? lock.l_pid : 0;
}

/// True for `abs_guardian serve`. It holds the card until a run has its lease.
bool is_resident(pid_t pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/cmdline");
  std::string program, command;
  std::getline(file, program, '\0');
  std::getline(file, command, '\0');
  return command == "serve";
}

[[noreturn]] void refuse_while_guarded(const std::filesystem::path& file, pid_t guardian) {
  if (is_resident(guardian)) {
    refuse_file(
        file,
        "process " + std::to_string(guardian) + " (" + process_name(guardian) +
            "), the resident service, keeps the card and lets go of it for a run with its lease; set "
            "guardian.resident=require, and guardian.socket to its socket; abs_hil doctor says who has the lease");
  }
  refuse_file(file, "process " + std::to_string(guardian) + " (" + process_name(guardian) +
                        ") still brings the card into the safe state after an earlier run; wait until it has ended");
}

void become_owner(const std::filesystem::path& file, int fd) {
  if (::flock(fd, LOCK_EX | LOCK_NB) != 0) {
    const int error = errno;
    if (error != EWOULDBLOCK) refuse_file(file, std::string("cannot be locked: ") + std::strerror(error));
    refuse_file(file,
                "the card is in use by " + lock_holder(fd) + "; a card has only one owner: end that process first");
  }
  if (const pid_t guardian = guardian_of(fd); guardian != 0) refuse_while_guarded(file, guardian);
}

bool set_guardian_lock(int fd, short type) noexcept {
  struct flock lock {};
  lock.l_type = type;
  lock.l_whence = SEEK_SET;
  return ::fcntl(fd, F_SETLK, &lock) == 0;
}

void become_guardian(const std::filesystem::path& file, int fd) {
  if (set_guardian_lock(fd, F_WRLCK)) return;
  const int error = errno;
  if (const pid_t guardian = guardian_of(fd); guardian != 0) refuse_while_guarded(file, guardian);
  refuse_file(file, std::string("cannot be locked: ") + std::strerror(error));
}

/// Makes one complete access; a partial access is an error.
template <typename Access>
IoResult whole_access(std::uint32_t where, ssize_t size, Access access) noexcept {
  constexpr int attempts = 3;  // signals may interrupt an access, but must not block the cycle for ever
  for (int attempt = 0; attempt < attempts; ++attempt) {
    const ssize_t done = access();
    if (done == size) return {};
    if (done >= 0) return {IoError::disconnected, where, 0};  // end of file: the BAR is gone
    if (errno != EINTR) return {io_error_for(errno), where, errno};
  }
  return {IoError::no_answer, where, EINTR};
}

class SysfsWindow final : public RegisterWindow {
 public:
  explicit SysfsWindow(const std::filesystem::path& resource_file, WindowUse use = WindowUse::owner)
      : file_(open_for_access(resource_file)) {
    if (use == WindowUse::guardian) become_guardian(resource_file, file_.get());
    if (use == WindowUse::owner) become_owner(resource_file, file_.get());
  }

  IoResult read32(std::uint32_t offset, std::uint32_t& value) noexcept override {
    std::uint32_t word = 0;
    const IoResult result = whole_access(
        offset, sizeof word, [&] { return ::pread(file_.get(), &word, sizeof word, static_cast<off_t>(offset)); });
    if (result.ok()) value = word;
    return result;
  }
  IoResult write32(std::uint32_t offset, std::uint32_t value) noexcept override {
    return whole_access(offset, sizeof value,
                        [&] { return ::pwrite(file_.get(), &value, sizeof value, static_cast<off_t>(offset)); });
  }
  void refuse_owners(bool refuse) noexcept override {
    static_cast<void>(set_guardian_lock(file_.get(), refuse ? F_WRLCK : F_UNLCK));
  }

 private:
  FileDescriptor file_;
};

class EmulatedTimeFile final : public EmulatedTime {
 public:
  explicit EmulatedTimeFile(const std::filesystem::path& file) : file_(open_for_access(file)) {}

  IoResult now(std::int64_t& time_ns) noexcept override {
    return whole_access(0, sizeof time_ns, [&] { return ::pread(file_.get(), &time_ns, sizeof time_ns, 0); });
  }
  IoResult advance_to(std::int64_t time_ns) noexcept override {
    return whole_access(0, sizeof time_ns, [&] { return ::pwrite(file_.get(), &time_ns, sizeof time_ns, 0); });
  }

 private:
  FileDescriptor file_;
};

}  // namespace

IoError io_error_for(int errno_value) noexcept {
  // A removed card gives ENODEV, a dead FUSE server ENOTCONN or ECONNABORTED.
  switch (errno_value) {
    case EAGAIN:
    case EBUSY:
    case EINTR:
    case ETIMEDOUT: return IoError::no_answer;
    case EACCES:
    case EPERM: return IoError::access_refused;
    default: return IoError::disconnected;
  }
}

std::unique_ptr<RegisterWindow> open_window(const std::filesystem::path& resource_file, WindowUse use) {
  return std::make_unique<SysfsWindow>(resource_file, use);
}

std::unique_ptr<EmulatedTime> open_emulated_time(const std::filesystem::path& file) {
  return std::make_unique<EmulatedTimeFile>(file);
}

}  // namespace abs_hil::driver::pci
