// Calls of Linux: processes by their pidfds, packets with descriptors, texts in memory.
#include "guardian/linux_process.hpp"

#include <grp.h>
#include <poll.h>
#include <pwd.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/syscall.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <ctime>

#include "abs_hil/rig/time_units.hpp"
#include "driver/sysfs.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::guardian {

namespace {

constexpr std::size_t most_files = 4;
union FileSpace {
  cmsghdr header;
  std::array<char, CMSG_SPACE(sizeof(int) * most_files)> bytes;
};

}  // namespace

int open_pidfd(pid_t process) noexcept {
  constexpr unsigned int no_flags = 0;  // a pidfd is always close-on-exec
  return static_cast<int>(::syscall(SYS_pidfd_open, process, no_flags));
}

bool become(uid_t user, gid_t group) {
  if (::geteuid() == user) return true;
  const passwd* const facts = ::getpwuid(user);
  const bool groups = facts != nullptr ? ::initgroups(facts->pw_name, group) == 0 : ::setgroups(1, &group) == 0;
  return groups && ::setresgid(group, group, group) == 0 && ::setresuid(user, user, user) == 0;
}

void close_all_but(std::vector<int> kept) noexcept {
  std::ranges::sort(kept);
  unsigned int from = STDERR_FILENO + 1;
  for (const int fd : kept) {
    if (fd < STDERR_FILENO + 1) continue;
    if (static_cast<unsigned int>(fd) > from) ::close_range(from, static_cast<unsigned int>(fd) - 1, 0);
    from = static_cast<unsigned int>(fd) + 1;
  }
  ::close_range(from, ~0U, 0);
}

int LinuxProcesses::open(pid_t pid) noexcept {
  const int pidfd = open_pidfd(pid);
  if (pidfd < 0 || send_signal(pidfd, 0)) return pidfd;
  ::close(pidfd);
  return -1;
}

bool is_readable(int fd, int timeout_ms) noexcept {
  pollfd readable{fd, POLLIN, 0};
  int ready = 0;
  do {
    ready = ::poll(&readable, 1, timeout_ms);  // POLLNVAL: there is nothing
  } while (ready < 0 && errno == EINTR);
  return ready > 0;
}

void wait_for_guard(const BoardGuard& guard, runtime::Clock& clock, Companions companions) noexcept {
  const std::int64_t left_ns = std::max<std::int64_t>(0, guard.next_ns() - clock.now_ns());
  const timespec left{.tv_sec = static_cast<time_t>(left_ns / rig::ns_per_s), .tv_nsec = left_ns % rig::ns_per_s};
  std::array<pollfd, 4> files{pollfd{guard.orders(), POLLIN, 0}, pollfd{guard.holder(), POLLIN, 0},
                              pollfd{companions[0], POLLIN, 0}, pollfd{companions[1], POLLIN, 0}};
  const bool over = ::ppoll(files.data(), files.size(), &left, nullptr) == 0;
  // A broken descriptor ends every wait at once: the guard must not keep the processor from all others.
  const auto readable = [](const pollfd& file) { return (file.revents & POLLIN) != 0; };
  if (!over && std::ranges::none_of(files, readable)) clock.sleep_until(guard.next_ns());
}

bool send_signal(int pidfd, int signal) noexcept {
  return ::syscall(SYS_pidfd_send_signal, pidfd, signal, nullptr, 0) == 0;
}

std::string name_of_process(pid_t pid) {
  const std::string name = driver::process_name(pid);
  return "process " + std::to_string(pid) + (name.empty() ? "" : " (" + rig::clean_text(name, 64) + ")");
}

pid_t process_of(int pidfd) {
  const std::string pid = driver::value_in("/proc/self/fdinfo/" + std::to_string(pidfd), "Pid:");
  return std::max(static_cast<pid_t>(std::strtol(pid.c_str(), nullptr, 10)), 0);
}

bool send_packet(int socket, std::span<const iovec> parts, std::span<const int> files) noexcept {
  msghdr packet{};
  packet.msg_iov = const_cast<iovec*>(parts.data());  // sendmsg changes nothing of it
  packet.msg_iovlen = parts.size();
  FileSpace space{};
  if (!files.empty() && files.size() <= most_files) {
    packet.msg_control = space.bytes.data();
    packet.msg_controllen = CMSG_SPACE(files.size_bytes());
    cmsghdr* const control = CMSG_FIRSTHDR(&packet);
    control->cmsg_level = SOL_SOCKET;
    control->cmsg_type = SCM_RIGHTS;
    control->cmsg_len = CMSG_LEN(files.size_bytes());
    std::memcpy(CMSG_DATA(control), files.data(), files.size_bytes());
  }
  std::size_t size = 0;
  for (const iovec& part : parts) size += part.iov_len;
  return ::sendmsg(socket, &packet, MSG_NOSIGNAL | MSG_DONTWAIT) == static_cast<ssize_t>(size);
}

ssize_t receive_packet(int socket, std::span<iovec> parts, std::vector<driver::FileDescriptor>& files) {
  FileSpace space{};
  msghdr packet{};
  packet.msg_iov = parts.data();
  packet.msg_iovlen = parts.size();
  packet.msg_control = space.bytes.data();
  packet.msg_controllen = space.bytes.size();
  ssize_t got = ::recvmsg(socket, &packet, MSG_CMSG_CLOEXEC | MSG_DONTWAIT);
  // The other side closed with a message of ours unread. What it had said before is still there.
  if (got < 0 && errno == ECONNRESET) got = ::recvmsg(socket, &packet, MSG_CMSG_CLOEXEC | MSG_DONTWAIT);
  for (cmsghdr* c = CMSG_FIRSTHDR(&packet); got >= 0 && c != nullptr; c = CMSG_NXTHDR(&packet, c)) {
    if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SCM_RIGHTS) continue;
    std::array<int, most_files> passed{};
    const std::size_t count = std::min((c->cmsg_len - CMSG_LEN(0)) / sizeof(int), passed.size());
    std::memcpy(passed.data(), CMSG_DATA(c), sizeof(int) * count);
    for (std::size_t i = 0; i < count; ++i) files.emplace_back(passed[i]);
  }
  return got;
}

int text_in_memory(const std::string& text) {
  const int fd = ::memfd_create("abs_hil launch config", MFD_CLOEXEC);
  if (fd < 0) return -1;
  if (::write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size())) return fd;
  ::close(fd);
  errno = EIO;
  return -1;
}

std::string text_behind(int fd) {
  constexpr std::size_t longest = std::size_t{1} << 20U;
  std::string text;
  std::array<char, 4096> part{};
  for (ssize_t got = 0;
       text.size() < longest && (got = ::pread(fd, part.data(), part.size(), static_cast<off_t>(text.size()))) > 0;) {
    text.append(part.data(), static_cast<std::size_t>(got));
  }
  return text;
}

}  // namespace abs_hil::guardian
