#include "study/durable_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <utility>

namespace abs_hil::study {

namespace {

std::string host_name() {
  std::array<char, 256> name{};
  if (::gethostname(name.data(), name.size() - 1) != 0) return "host";
  return name.data();
}

/// No other process on any computer writes under this name.
std::string part_of(const std::filesystem::path& path, const std::filesystem::path& folder) {
  static std::atomic<unsigned> number{0};
  const std::string name =
      fmt::format(".{}.{}.{}.{}.part", path.filename().string(), host_name(), ::getpid(), number.fetch_add(1));
  return ((folder.empty() ? path.parent_path() : folder) / name).string();
}

}  // namespace

DurableFile::DurableFile(std::filesystem::path path, const std::filesystem::path& folder)
    : path_(std::move(path)), part_(part_of(path_, folder)) {
  file_ = ::open(part_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (file_ < 0) fail();
}

DurableFile::~DurableFile() {
  if (file_ >= 0) ::close(file_);
  if (!part_.empty()) ::unlink(part_.c_str());
}

void DurableFile::fail() const {
  throw std::runtime_error(fmt::format("cannot write \"{}\": {}", path_.string(), std::strerror(errno)));
}

void DurableFile::append(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(file_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail();
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

void DurableFile::commit() {
  if (::fsync(file_) != 0 || ::close(std::exchange(file_, -1)) != 0) fail();
  if (::rename(part_.c_str(), path_.c_str()) != 0) fail();
  part_.clear();
  // The new name, too. A file system that cannot do this for folders does it by itself.
  const std::string folder = path_.has_parent_path() ? path_.parent_path().string() : ".";
  const int opened = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (opened < 0) return;
  ::fsync(opened);
  ::close(opened);
}

void write_durably(const std::filesystem::path& path, std::string_view bytes, const std::filesystem::path& folder) {
  DurableFile file(path, folder);
  file.append(bytes);
  file.commit();
}

}  // namespace abs_hil::study
