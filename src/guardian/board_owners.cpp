// Finds the process that has a board open, by the files below /proc.
#include "guardian/board_owners.hpp"

#include <dirent.h>
#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <sstream>
#include <string_view>

#include "abs_hil/rig/time_units.hpp"
#include "driver/file_descriptor.hpp"
#include "driver/monotonic_time.hpp"
#include "guardian/guard.hpp"
#include "guardian/linux_process.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::guardian {

namespace {

using driver::FileDescriptor;

/// Device and inode of a file: the same for every path and every descriptor of it.
struct FileId {
  std::uint32_t major{0};
  std::uint32_t minor{0};
  std::uint64_t inode{0};
  [[nodiscard]] bool operator==(const FileId&) const = default;
};

/// What the kernel remembers of the file: a file system that hangs is not asked.
std::optional<FileId> id_of(int folder, const char* name) {
  struct statx found {};
  const int flags = AT_STATX_DONT_SYNC | AT_NO_AUTOMOUNT | AT_EMPTY_PATH;
  if (::statx(folder, name, flags, STATX_INO, &found) != 0) return std::nullopt;
  return FileId{found.stx_dev_major, found.stx_dev_minor, found.stx_ino};
}

using Folder = std::unique_ptr<DIR, int (*)(DIR*)>;

Folder open_folder(int in, const char* name) {
  const int fd = ::openat(in, name, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  return {fd < 0 ? nullptr : ::fdopendir(fd), ::closedir};
}

/// One small file of /proc, which the kernel writes by itself; empty if it cannot be read.
std::string text_of(int in, const std::string& name) {
  const FileDescriptor file(::openat(in, name.c_str(), O_RDONLY | O_CLOEXEC));
  std::array<char, 256> text{};
  const ssize_t got = file.get() < 0 ? 0 : ::read(file.get(), text.data(), text.size());
  return {text.data(), got > 0 ? static_cast<std::size_t>(got) : 0};
}

constexpr std::string_view udp = "udp:";

/// The sockets of this computer that are connected to a UDP peer, as the kernel's table names it.
void add_sockets_to(std::string_view peer, std::vector<FileId>& found) {
  const FileDescriptor any(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  const auto socket_id = id_of(any.get(), "");  // all sockets are on one device
  if (!socket_id) return;
  std::ifstream table("/proc/self/net/udp");
  for (std::string line; std::getline(table, line);) {
    std::istringstream words(line);
    std::string word, remote;
    std::uint64_t inode = 0;
    words >> word >> word >> remote;
    for (int i = 0; i < 6; ++i) words >> word;  // state, queues, timer, retransmissions, user, timeout
    if (remote == peer && words >> inode) found.push_back({socket_id->major, socket_id->minor, inode});
  }
}

/// A guardian or `abs_hil safe` of this installation. Any process can take their names. The program of another user's
/// process cannot be seen by all; then the name counts.
bool writes_zeros_only(int proc, const std::string& pid, std::string_view name) {
  std::error_code error;
  const std::filesystem::path guardian = std::filesystem::weakly_canonical(guardian_program(), error);
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/" + pid + "/exe", error);
  if (error) return name == "abs_guardian";
  if (program.string().starts_with(guardian.string())) return true;  // " (deleted)" follows after an upgrade
  constexpr std::string_view safe("\0safe\0", 6);
  return program.parent_path() == guardian.parent_path() &&
         text_of(proc, pid + "/cmdline").find(safe) != std::string::npos;
}

struct FileOfBoard {
  FileId id{};
  std::size_t board{0};
};

/// The board of which this process has a file open.
std::optional<std::size_t> board_of(int proc, const std::string& pid, const std::vector<FileOfBoard>& files) {
  const Folder open_files = open_folder(proc, (pid + "/fd").c_str());
  if (!open_files) return std::nullopt;
  while (const dirent* entry = ::readdir(open_files.get())) {
    const auto id = id_of(::dirfd(open_files.get()), entry->d_name);
    const auto file = std::ranges::find_if(files, [&](const FileOfBoard& f) { return id && f.id == *id; });
    if (file != files.end()) return file->board;
  }
  return std::nullopt;
}

bool is_stopped(pid_t pid) {
  // "PID (NAME) STATE ...": a name may hold brackets.
  const std::string stat = text_of(AT_FDCWD, "/proc/" + std::to_string(pid) + "/stat");
  const std::size_t at = stat.rfind(") ");
  return at != std::string::npos && (stat[at + 2] == 'T' || stat[at + 2] == 't');
}

/// False if the process may not be ended.
bool send(int pidfd, int signal) { return send_signal(pidfd, signal) || errno != EPERM; }

}  // namespace

std::vector<std::string> files_of_board(const driver::DriverOptions& options) {
  const driver::ChosenBackend chosen = driver::chosen_backend(options);
  std::vector<std::string> files;
  if (chosen.entry.udp_peer) files.push_back(std::string(udp) + chosen.entry.udp_peer(chosen.options));
  if (!chosen.entry.find) return files;
  for (const driver::FoundBoard& board : chosen.entry.find(chosen.options)) {
    files.insert(files.end(), board.files.begin(), board.files.end());
  }
  return files;
}

std::vector<BoardOwner> owners_of(const std::vector<std::vector<std::string>>& files) {
  std::vector<FileOfBoard> wanted;
  for (std::size_t board = 0; board < files.size(); ++board) {
    for (const std::string& file : files[board]) {
      std::vector<FileId> ids;
      if (file.starts_with(udp)) add_sockets_to(std::string_view(file).substr(udp.size()), ids);
      if (const auto id = id_of(AT_FDCWD, file.c_str())) ids.push_back(*id);
      for (const FileId& id : ids) wanted.push_back({id, board});
    }
  }
  std::vector<BoardOwner> owners;
  const Folder proc = open_folder(AT_FDCWD, "/proc");
  if (wanted.empty() || !proc) return owners;
  while (const dirent* entry = ::readdir(proc.get())) {
    const std::string number = entry->d_name;
    const auto pid = rig::parse_number<pid_t>(number);
    if (!pid || *pid == ::getpid()) continue;
    const auto board = board_of(::dirfd(proc.get()), number, wanted);
    if (!board) continue;
    std::string name = text_of(::dirfd(proc.get()), number + "/comm");
    if (name.ends_with('\n')) name.pop_back();
    if (!writes_zeros_only(::dirfd(proc.get()), number, name))
      owners.push_back({.pid = *pid, .name = name, .board = *board});
  }
  return owners;
}

void end_owners(std::vector<BoardOwner>& owners,
                const std::function<bool(std::size_t board, std::int64_t asked_ns)>& must_go) {
  constexpr std::int64_t patience_ns = rig::ns_per_s;
  constexpr std::int64_t give_up_ns = 2500 * rig::ns_per_ms;
  constexpr int pause_ms = 2;
  struct Process {
    BoardOwner& owner;
    FileDescriptor pidfd;
    bool refused{false};  ///< this user may not end it
  };
  const std::int64_t asked_ns = driver::monotonic_ns();
  std::vector<Process> left;
  for (BoardOwner& owner : owners) {
    left.push_back({owner, FileDescriptor(open_pidfd(owner.pid))});
    owner.ended = left.back().pidfd.get() < 0 && errno == ESRCH;
    if (!is_stopped(owner.pid)) left.back().refused = !send(left.back().pidfd.get(), SIGTERM);
  }
  for (std::int64_t now_ns = asked_ns; now_ns < asked_ns + give_up_ns; now_ns = driver::monotonic_ns()) {
    bool done = true;
    for (auto& [owner, pidfd, refused] : left) {
      if (!owner.ended) owner.ended = has_ended(pidfd.get());
      if (owner.ended || refused) continue;
      done = false;
      if (owner.killed) continue;
      owner.killed = is_stopped(owner.pid) || now_ns - asked_ns > patience_ns || must_go(owner.board, asked_ns);
      if (owner.killed) refused = !send(pidfd.get(), SIGKILL);
    }
    if (done) return;
    static_cast<void>(::poll(nullptr, 0, pause_ms));
  }
}

std::vector<std::string> end_unguarded(const std::vector<std::string>& files, pid_t holder) {
  constexpr std::int64_t ends_within_ns = 20 * rig::ns_per_ms;
  std::vector<BoardOwner> owners = owners_of({files});
  if (owners.size() > 1) std::erase_if(owners, [holder](const BoardOwner& owner) { return owner.pid == holder; });
  const auto must_go = [](auto, std::int64_t asked_ns) { return driver::monotonic_ns() > asked_ns + ends_within_ns; };
  end_owners(owners, must_go);
  std::vector<std::string> done;
  for (const BoardOwner& owner : owners) {
    done.push_back("process " + std::to_string(owner.pid) + " (" + rig::clean_text(owner.name, 64) +
                   ") drove the board without being guarded, and " +
                   (owner.ended ? "was ended" : "could not be ended"));
  }
  if (owners.empty()) done.emplace_back("something drives the board, and no process of this computer has it open");
  return done;
}

}  // namespace abs_hil::guardian
