// ResultFile on Windows, which has neither pipes and devices among its files nor Linux's calls.
#include <fcntl.h>
#include <io.h>
#include <process.h>
#include <sys/stat.h>

#include <atomic>
#include <cerrno>
#include <system_error>
#include <utility>

#include "files/result_file.hpp"

namespace abs_hil::files {

namespace fs = std::filesystem;

ResultFile::ResultFile(fs::path path, std::string kind, const fs::path& part_folder)
    : path_(std::move(path)), kind_(std::move(kind)) {
  buffer_.reserve(buffer_bytes);
  open_target(path_, 0);
  open_part(part_folder);
}

ResultFile::~ResultFile() {
  if (file_ >= 0) ::_close(file_);
  std::error_code ignored;
  if (!part_.empty()) fs::remove(part_, ignored);
}

void ResultFile::fail(int error_number) const { throw FileError(kind_, path_, error_number); }

void ResultFile::open_target(const fs::path& path, int /*links*/) {
  std::error_code error;
  if (!path.has_filename()) fail(path.empty() ? ENOENT : EISDIR);
  const fs::file_status there = fs::status(path, error);
  if (fs::is_directory(there)) fail(EISDIR);
  if (fs::exists(there) && !fs::is_regular_file(there)) {
    throw FileError(kind_, path_, "it is no regular file; choose another path", EINVAL);
  }
  target_ = fs::exists(there) ? fs::canonical(path, error) : path;
  if (error && fs::exists(there)) fail(EACCES);
}

void ResultFile::open_part(const fs::path& folder) {
  static std::atomic<unsigned> number{0};
  const fs::path beside = folder.empty() ? target_.parent_path() : folder;
  do {
    part_ = beside / ('.' + target_.filename().string() + '.' + std::to_string(::_getpid()) + '.' +
                      std::to_string(number.fetch_add(1)) + ".part");
    file_ = ::_wopen(part_.c_str(), _O_WRONLY | _O_CREAT | _O_EXCL | _O_BINARY | _O_NOINHERIT, _S_IREAD | _S_IWRITE);
  } while (file_ < 0 && errno == EEXIST);
  if (file_ >= 0) return;
  part_.clear();
  fail(errno);
}

void ResultFile::put(std::string_view bytes) {
  constexpr std::size_t write_bytes = 1U << 20U;  // at once: the call takes a number of 32 bits
  while (!bytes.empty()) {
    const int written =
        ::_write(file_, bytes.data(), static_cast<unsigned>(bytes.size() < write_bytes ? bytes.size() : write_bytes));
    if (written <= 0) fail(written == 0 ? EIO : errno);
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

/// Windows renames no open file: a file that is not whole stays beside its place.
void ResultFile::show() {}

void ResultFile::commit() {
  flush();
  if (::_commit(file_) != 0) fail(errno);
  if (::_close(std::exchange(file_, -1)) != 0) fail(errno);
  std::error_code error;
  fs::rename(part_, target_, error);
  if (error) fail(EACCES);
  part_.clear();
}

}  // namespace abs_hil::files
