// What the C library asks of a system (WASI), answered within the module, so that it imports nothing: the program's
// configuration files as a folder /config that can only be read, files that the page gives in /given, a clock that
// stands still, and no others. The texts of the configuration files are compiled in (configuration_files.inc).
#include "files.hpp"

#include <wasi/api.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <map>
#include <optional>
#include <string_view>
#include <vector>

// What C++ throws in WebAssembly: this tag, with the address of the exception. The compiler's programs define it for a
// linker that makes libraries for a running process; a module by itself has to bring it.
__asm__(
    ".tagtype __cpp_exception i32\n"
    ".globl __cpp_exception\n"
    "__cpp_exception:\n");

namespace abs_hil::lab {

namespace {

using Path = std::string;

std::map<Path, std::string_view>& files() {
  static std::map<Path, std::string_view> all = [] {
    std::map<Path, std::string_view> compiled_in;
    const auto add = [&compiled_in](const char* path, const unsigned char* text, std::size_t size) {
      compiled_in[path] = {reinterpret_cast<const char*>(text), size};
    };
#include "configuration_files.inc"
    return compiled_in;
  }();
  return all;
}

std::map<Path, std::string>& given_files() {
  static std::map<Path, std::string> all;
  return all;
}

/// Without leading, trailing and repeated slashes, and without dots.
Path clean(std::string_view path) {
  Path cleaned;
  while (!path.empty()) {
    const std::size_t end = std::min(path.find('/'), path.size());
    const std::string_view part = path.substr(0, end);
    path.remove_prefix(std::min(end + 1, path.size()));
    if (part.empty() || part == ".") continue;
    if (!cleaned.empty()) cleaned += '/';
    cleaned += part;
  }
  return cleaned;
}

/// The names in a folder, with true for those that are folders themselves; none: it is no folder.
std::map<std::string, bool> entries(const Path& folder) {
  const Path prefix = folder.empty() ? "" : folder + '/';
  std::map<std::string, bool> names;
  for (auto at = files().lower_bound(prefix); at != files().end() && at->first.starts_with(prefix); ++at) {
    const std::string rest = at->first.substr(prefix.size());
    const std::size_t slash = rest.find('/');
    names[rest.substr(0, slash)] = slash != std::string::npos;
  }
  return names;
}

struct Open {
  Path path;
  bool folder;
  std::size_t at{0};
};

constexpr std::int32_t root = 3;  // the first number after the standard streams

std::map<std::int32_t, Open>& open_files() {
  static std::map<std::int32_t, Open> all{{root, {.path = "", .folder = true}}};
  return all;
}

Open* find(std::int32_t number) {
  const auto found = open_files().find(number);
  return found == open_files().end() ? nullptr : &found->second;
}

std::optional<Open> look(std::string_view given) {
  const Path path = clean(given);
  if (files().contains(path)) return Open{.path = path, .folder = false};
  if (path.empty() || !entries(path).empty()) return Open{.path = path, .folder = true};
  return std::nullopt;
}

template <class T>
T& at(std::int32_t address) {
  return *reinterpret_cast<T*>(address);
}

__wasi_filestat_t facts(const Open& file) {
  return {.ino = std::hash<std::string>{}(file.path),
          .filetype = static_cast<std::uint8_t>(file.folder ? __WASI_FILETYPE_DIRECTORY : __WASI_FILETYPE_REGULAR_FILE),
          .nlink = 1,
          .size = file.folder ? 0 : files().at(file.path).size()};
}

}  // namespace

void give_file(const std::string& path, std::string text) {
  std::string& kept = given_files()[clean(path)];
  kept = std::move(text);
  files()[clean(path)] = kept;
}

}  // namespace abs_hil::lab

using namespace abs_hil::lab;

// NOLINTBEGIN(bugprone-reserved-identifier): the C library's names for what it would import.
#define WASI(name) std::int32_t __imported_wasi_snapshot_preview1_##name
extern "C" {

WASI(environ_sizes_get)(std::int32_t count, std::int32_t bytes) {
  at<std::uint32_t>(count) = at<std::uint32_t>(bytes) = 0;
  return __WASI_ERRNO_SUCCESS;
}
WASI(environ_get)(std::int32_t, std::int32_t) { return __WASI_ERRNO_SUCCESS; }
WASI(args_sizes_get)(std::int32_t count, std::int32_t bytes) {
  at<std::uint32_t>(count) = at<std::uint32_t>(bytes) = 0;
  return __WASI_ERRNO_SUCCESS;
}
WASI(args_get)(std::int32_t, std::int32_t) { return __WASI_ERRNO_SUCCESS; }

WASI(clock_res_get)(std::int32_t, std::int32_t result) {
  at<std::uint64_t>(result) = 1;
  return __WASI_ERRNO_SUCCESS;
}
WASI(clock_time_get)(std::int32_t, std::int64_t, std::int32_t result) {
  at<std::uint64_t>(result) = 0;
  return __WASI_ERRNO_SUCCESS;
}

WASI(fd_prestat_get)(std::int32_t number, std::int32_t result) {
  if (number != root) return __WASI_ERRNO_BADF;
  at<__wasi_prestat_t>(result) = {.tag = __WASI_PREOPENTYPE_DIR, .u = {.dir = {.pr_name_len = 1}}};
  return __WASI_ERRNO_SUCCESS;
}
WASI(fd_prestat_dir_name)(std::int32_t, std::int32_t text, std::int32_t) {
  at<char>(text) = '/';
  return __WASI_ERRNO_SUCCESS;
}

WASI(path_open)
(std::int32_t, std::int32_t, std::int32_t path, std::int32_t size, std::int32_t flags, std::int64_t, std::int64_t,
 std::int32_t, std::int32_t result) {
  const std::optional<Open> found = look({&at<char>(path), static_cast<std::size_t>(size)});
  if (!found) return (flags & __WASI_OFLAGS_CREAT) != 0 ? __WASI_ERRNO_ROFS : __WASI_ERRNO_NOENT;
  if ((flags & __WASI_OFLAGS_TRUNC) != 0) return __WASI_ERRNO_ROFS;
  if ((flags & __WASI_OFLAGS_DIRECTORY) != 0 && !found->folder) return __WASI_ERRNO_NOTDIR;
  const std::int32_t number = open_files().rbegin()->first + 1;
  open_files()[number] = *found;
  at<std::int32_t>(result) = number;
  return __WASI_ERRNO_SUCCESS;
}
WASI(fd_close)(std::int32_t number) {
  if (number > root) open_files().erase(number);
  return __WASI_ERRNO_SUCCESS;
}
/// zig's own close() would import the function of the system by another way.
int close(int number) { return __imported_wasi_snapshot_preview1_fd_close(number); }
WASI(fd_fdstat_get)(std::int32_t number, std::int32_t result) {
  const Open* file = find(number);
  if (file == nullptr) return __WASI_ERRNO_BADF;
  at<__wasi_fdstat_t>(result) = {.fs_filetype = facts(*file).filetype,
                                 .fs_rights_base = ~std::uint64_t{0},
                                 .fs_rights_inheriting = ~std::uint64_t{0}};
  return __WASI_ERRNO_SUCCESS;
}
WASI(fd_fdstat_set_flags)(std::int32_t, std::int32_t) { return __WASI_ERRNO_SUCCESS; }
WASI(fd_filestat_get)(std::int32_t number, std::int32_t result) {
  const Open* file = find(number);
  if (file == nullptr) return __WASI_ERRNO_BADF;
  at<__wasi_filestat_t>(result) = facts(*file);
  return __WASI_ERRNO_SUCCESS;
}
WASI(path_filestat_get)(std::int32_t, std::int32_t, std::int32_t path, std::int32_t size, std::int32_t result) {
  const std::optional<Open> found = look({&at<char>(path), static_cast<std::size_t>(size)});
  if (!found) return __WASI_ERRNO_NOENT;
  at<__wasi_filestat_t>(result) = facts(*found);
  return __WASI_ERRNO_SUCCESS;
}
WASI(path_readlink)(std::int32_t, std::int32_t, std::int32_t, std::int32_t, std::int32_t, std::int32_t) {
  return __WASI_ERRNO_INVAL;  // no file here is a link
}
WASI(fd_read)(std::int32_t number, std::int32_t parts, std::int32_t count, std::int32_t result) {
  Open* file = find(number);
  if (file == nullptr || file->folder) return __WASI_ERRNO_BADF;
  const std::string_view text = files().at(file->path);
  std::uint32_t got = 0;
  for (std::int32_t n = 0; n < count; ++n) {
    const __wasi_iovec_t& part = (&at<__wasi_iovec_t>(parts))[n];
    const std::size_t size = text.copy(reinterpret_cast<char*>(part.buf), part.buf_len, file->at);
    file->at += size;
    got += size;
  }
  at<std::uint32_t>(result) = got;
  return __WASI_ERRNO_SUCCESS;
}
WASI(fd_seek)(std::int32_t number, std::int64_t offset, std::int32_t whence, std::int32_t result) {
  Open* file = find(number);
  if (file == nullptr || file->folder) return __WASI_ERRNO_SPIPE;
  const auto size = static_cast<std::int64_t>(files().at(file->path).size());
  const std::int64_t from = whence == __WASI_WHENCE_SET   ? 0
                            : whence == __WASI_WHENCE_CUR ? std::int64_t(file->at)
                                                          : size;
  if (from + offset < 0 || from + offset > size) return __WASI_ERRNO_INVAL;
  file->at = static_cast<std::size_t>(from + offset);
  at<std::uint64_t>(result) = file->at;
  return __WASI_ERRNO_SUCCESS;
}
WASI(fd_write)(std::int32_t number, std::int32_t parts, std::int32_t count, std::int32_t result) {
  if (number != 1 && number != 2) return __WASI_ERRNO_BADF;  // messages go nowhere: errors are exceptions
  at<std::uint32_t>(result) = 0;
  for (std::int32_t n = 0; n < count; ++n) at<std::uint32_t>(result) += (&at<__wasi_ciovec_t>(parts))[n].buf_len;
  return __WASI_ERRNO_SUCCESS;
}
WASI(fd_readdir)
(std::int32_t number, std::int32_t buffer, std::int32_t size, std::int64_t cookie, std::int32_t result) {
  const Open* folder = find(number);
  if (folder == nullptr || !folder->folder) return __WASI_ERRNO_NOTDIR;
  std::string all;
  std::uint64_t next = 0;
  for (const auto& [name, is_folder] : entries(folder->path)) {
    if (next++ < static_cast<std::uint64_t>(cookie)) continue;
    const __wasi_dirent_t entry{
        .d_next = next,
        .d_ino = next,
        .d_namlen = static_cast<std::uint32_t>(name.size()),
        .d_type = static_cast<std::uint8_t>(is_folder ? __WASI_FILETYPE_DIRECTORY : __WASI_FILETYPE_REGULAR_FILE)};
    all.append(reinterpret_cast<const char*>(&entry), sizeof entry).append(name);
  }
  at<std::uint32_t>(result) = static_cast<std::uint32_t>(all.copy(&at<char>(buffer), static_cast<std::size_t>(size)));
  return __WASI_ERRNO_SUCCESS;
}
WASI(random_get)(std::int32_t buffer, std::int32_t size) {
  std::memset(&at<char>(buffer), 0, static_cast<std::size_t>(size));
  return __WASI_ERRNO_SUCCESS;
}
WASI(sched_yield)() { return __WASI_ERRNO_SUCCESS; }
[[noreturn]] void __imported_wasi_snapshot_preview1_proc_exit(std::int32_t) { __builtin_trap(); }

#define REFUSED(name, ...) \
  WASI(name)(__VA_ARGS__) { return __WASI_ERRNO_ROFS; }
using I = std::int32_t;
using L = std::int64_t;
REFUSED(path_create_directory, I, I, I)
REFUSED(path_remove_directory, I, I, I)
REFUSED(path_unlink_file, I, I, I)
REFUSED(path_rename, I, I, I, I, I, I)
REFUSED(path_link, I, I, I, I, I, I, I)
REFUSED(path_symlink, I, I, I, I, I)
REFUSED(path_filestat_set_times, I, I, I, I, L, L, I)
REFUSED(fd_filestat_set_size, I, L)
REFUSED(fd_filestat_set_times, I, L, L, I)
REFUSED(fd_allocate, I, L, L)
REFUSED(fd_pwrite, I, I, I, L, I)
REFUSED(fd_sync, I)
REFUSED(fd_datasync, I)
REFUSED(fd_renumber, I, I)
REFUSED(poll_oneoff, I, I, I, I)

}  // extern "C"
// NOLINTEND(bugprone-reserved-identifier)
