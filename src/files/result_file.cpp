// Writes a file under another name, syncs it and renames it. Windows has result_file_windows.cpp.
#include "files/result_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <mutex>
#include <set>
#include <system_error>
#include <utility>

#include "rig/formatted_text.hpp"

namespace abs_hil::files {

namespace fs = std::filesystem;

namespace {

constexpr int links_max = 40;  // as the kernel

std::string folder_of(const fs::path& path) { return path.has_parent_path() ? path.parent_path().string() : "."; }

/// No other process on any computer writes under this name. It is short, however long the result's name is.
std::string part_name(const fs::path& target) {
  static std::atomic<unsigned> number{0};
  constexpr std::size_t shown = 100;
  std::array<char, 65> host{};
  static_cast<void>(::gethostname(host.data(), host.size() - 1));
  return '.' + target.filename().string().substr(0, shown) + '.' + host.data() + '.' + std::to_string(::getpid()) +
         '.' + std::to_string(number.fetch_add(1)) + ".part";
}

/// A descriptor of this program's stdout or stderr, if they are this file. Opened again, it would begin at its start.
int own_output(const struct stat& facts) {
  for (const int own : {STDOUT_FILENO, STDERR_FILENO}) {
    struct stat there {};
    if (::fstat(own, &there) != 0 || there.st_dev != facts.st_dev || there.st_ino != facts.st_ino) continue;
    return ::fcntl(own, F_DUPFD_CLOEXEC, STDERR_FILENO + 1);
  }
  return -1;
}

/// The files that this process reads, and those that it has open as results, by their canonical paths.
struct KnownFiles {
  std::mutex mutex{};
  std::set<fs::path> inputs{};
  std::set<fs::path> results{};
};
KnownFiles& known_files() {
  static KnownFiles known;
  return known;
}

fs::path place_of(const fs::path& path) {
  std::error_code error;
  const fs::path found = fs::weakly_canonical(fs::absolute(path, error), error);
  return error ? path : found;
}

/// The returned object gives the place free again.
std::shared_ptr<void> claim(const std::string& kind, const fs::path& path, const fs::path& target) {
  const fs::path place = place_of(target);
  const std::scoped_lock lock(known_files().mutex);
  const auto& inputs = known_files().inputs;
  if (inputs.contains(place) || inputs.contains(place.parent_path())) {
    throw FileError(kind, path, "this command reads it; give another file", EEXIST);
  }
  if (!known_files().results.insert(place).second) {
    throw FileError(kind, path, "another result goes into the same file; give each its own", EEXIST);
  }
  return {nullptr, [place](void*) {
            const std::scoped_lock again(known_files().mutex);
            known_files().results.erase(place);
          }};
}

std::atomic<bool> stdout_taken{false};

}  // namespace

std::FILE* for_people() noexcept { return stdout_taken ? stderr : stdout; }

void note_input(const fs::path& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error) && !fs::is_directory(path, error)) return;
  const std::scoped_lock lock(known_files().mutex);
  known_files().inputs.insert(place_of(path));
}

ResultFile::ResultFile(fs::path path, std::string kind, const fs::path& part_folder)
    : path_(std::move(path)), kind_(std::move(kind)) {
  buffer_.reserve(buffer_bytes);
  const bool to_stdout = path_ == "-";
  open_target(to_stdout ? "/dev/stdout" : path_, 0);
  if (to_stdout) {
    claim_ = claim(kind_, path_, path_);
    stdout_taken = true;
  }
  if (!target_.empty()) claim_ = claim(kind_, path_, target_);
  if (file_ < 0) open_part(part_folder);
}

ResultFile::~ResultFile() {
  if (file_ >= 0) ::close(file_);
  if (!part_.empty()) ::unlink(part_.c_str());
}

void ResultFile::fail(int error_number) const {
  const fs::path& place = target_.empty() ? path_ : target_;  // behind a link
  throw FileError(kind_, path_, rig::refusal(error_number, place.string(), rig::writing), error_number);
}

/// Opens a stream, or finds the place of the file.
void ResultFile::open_target(const fs::path& path, int links) {
  if (!path.has_filename()) fail(path.empty() ? ENOENT : EISDIR);
  struct stat facts {};
  if (::stat(path.c_str(), &facts) != 0) {
    if (errno != ENOENT) fail(errno);
    std::error_code error;
    const fs::path named = fs::read_symlink(path, error);
    if (error) {
      target_ = path;
      return;
    }
    if (links >= links_max) fail(ELOOP);
    return open_target(path.parent_path() / named, links + 1);
  }
  if (S_ISDIR(facts.st_mode)) fail(EISDIR);
  if (S_ISBLK(facts.st_mode)) throw FileError(kind_, path_, "it is a block device; choose another path", EINVAL);
  if (S_ISSOCK(facts.st_mode)) throw FileError(kind_, path_, "it is a socket; choose another path", EINVAL);
  file_ = own_output(facts);
  if (file_ >= 0) return;
  if (S_ISREG(facts.st_mode)) {
    if (::access(path.c_str(), W_OK) != 0) fail(errno);
    std::error_code error;
    target_ = fs::canonical(path, error);
    if (error) fail(error.value());
    mode_ = facts.st_mode & (S_IRWXU | S_IRWXG | S_IRWXO);
    return;
  }
  // Without waiting for somebody who reads from a pipe.
  file_ = ::open(path.c_str(), O_WRONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
  if (file_ < 0 && errno == ENXIO && S_ISFIFO(facts.st_mode)) {
    throw FileError(kind_, path_, "nobody reads from this pipe; start its reader first", ENXIO);
  }
  if (file_ < 0 || ::fcntl(file_, F_SETFL, 0) != 0) fail(errno);
}

void ResultFile::open_part(const fs::path& folder) {
  do {
    part_ = (folder.empty() ? target_.parent_path() : folder) / part_name(target_);
    file_ = ::open(part_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  } while (file_ < 0 && (errno == EEXIST || errno == EINTR));
  if (file_ >= 0) {
    if (mode_ != 0) static_cast<void>(::fchmod(file_, mode_));
    return;
  }
  part_.clear();
  fail(errno);
}

void ResultFile::put(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(file_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) fail(written == 0 ? EIO : errno);
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

void ResultFile::show() {
  if (part_.empty()) return;
  // Somebody may have put something else in its place meanwhile.
  struct stat facts {};
  if (::lstat(target_.c_str(), &facts) == 0 && !S_ISREG(facts.st_mode)) {
    throw FileError(kind_, path_, "something that is no regular file has taken its place; choose another path", EEXIST);
  }
  if (::rename(part_.c_str(), target_.c_str()) != 0) fail(errno);
  part_.clear();
}

void ResultFile::commit() {
  flush();
  if (!target_.empty() && ::fsync(file_) != 0) fail(errno);
  // Some file systems (NFS, quotas) report lost data only here.
  if (::close(std::exchange(file_, -1)) != 0 && errno != EINTR) fail(errno);
  if (target_.empty()) return;
  show();
  // The new name, too. A file system that cannot do this for folders does it by itself.
  const int folder = ::open(folder_of(target_).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (folder < 0) return;
  static_cast<void>(::fsync(folder));
  ::close(folder);
}

}  // namespace abs_hil::files
