#include "program/board_owners.hpp"

#include <poll.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <system_error>

namespace abs_hil::program {

namespace {

namespace fs = std::filesystem;

/// Device and inode of a file: the same for every path and every descriptor of it.
struct FileId {
  dev_t device{0};
  ino_t inode{0};
  [[nodiscard]] bool operator==(const FileId&) const = default;
};

bool find_id(const std::string& path, FileId& id) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return false;
  id = {status.st_dev, status.st_ino};
  return true;
}

bool has_open(const fs::path& process, const std::vector<FileId>& files) {
  std::error_code error;
  for (fs::directory_iterator at(process / "fd", error), end; !error && at != end; at.increment(error)) {
    FileId id;
    if (find_id(at->path().string(), id) && std::ranges::find(files, id) != files.end()) return true;
  }
  return false;
}

std::string name_of_process(const fs::path& process) {
  std::ifstream in(process / "comm");
  std::string name;
  std::getline(in, name);
  return name;
}

bool ends_within(int pidfd, int timeout_ms) {
  pollfd ended{pidfd, POLLIN, 0};
  return ::poll(&ended, 1, timeout_ms) > 0;
}

}  // namespace

std::vector<BoardOwner> owners_of(const std::vector<std::string>& files) {
  std::vector<FileId> ids;
  for (const std::string& file : files) {
    if (FileId id; find_id(file, id)) ids.push_back(id);
  }
  std::vector<BoardOwner> owners;
  std::error_code error;
  for (fs::directory_iterator at("/proc", error), end; !error && at != end; at.increment(error)) {
    const std::string number = at->path().filename().string();
    pid_t pid = 0;
    const auto [rest, wrong] = std::from_chars(number.data(), number.data() + number.size(), pid);
    if (wrong != std::errc() || rest != number.data() + number.size() || pid == ::getpid()) continue;
    if (!has_open(at->path(), ids)) continue;
    const std::string name = name_of_process(at->path());
    if (name != "abs_guardian") owners.push_back({pid, name});
  }
  return owners;
}

bool end_owner(const BoardOwner& owner) {
  constexpr unsigned int no_flags = 0;
  const int pidfd = static_cast<int>(::syscall(SYS_pidfd_open, owner.pid, no_flags));
  if (pidfd < 0) return errno == ESRCH;
  // The first request ends a run in order, which may brake the rig first. The second ends it at once.
  struct Request {
    int signal;
    int wait_ms;
  };
  bool ended = false;
  for (const auto& [signal, wait_ms] : {Request{SIGTERM, 300}, Request{SIGTERM, 300}, Request{SIGKILL, 1500}}) {
    if (::syscall(SYS_pidfd_send_signal, pidfd, signal, nullptr, 0) != 0 && errno == EPERM) break;
    if ((ended = ends_within(pidfd, wait_ms))) break;
  }
  ::close(pidfd);
  return ended;
}

}  // namespace abs_hil::program
