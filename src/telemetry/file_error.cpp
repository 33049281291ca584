#include "telemetry/file_error.hpp"

#include <cerrno>
#include <string>
#include <system_error>

namespace abs_hil::telemetry {
namespace {

std::string fix_for(const std::filesystem::path& path, int error_number) {
  const std::string directory = path.has_parent_path() ? path.parent_path().string() : ".";
  switch (error_number) {
    case ENOENT: return "create the directory first: mkdir -p '" + directory + "'";
    case ENOTDIR: return "a part of the path is a file, not a directory: choose another path";
    case EISDIR: return "this is a directory: add a file name";
    case EACCES:
    case EPERM: return "choose a place that you may write to, or get the right to write to '" + directory + "'";
    case EROFS: return "the file system is read-only: choose another place";
    case ENOSPC:
    case EDQUOT: return "free some space on that file system, or choose another";
    case EFBIG: return "the file reached the size limit: raise it (ulimit -f), or log less";
    case EMFILE:
    case ENFILE: return "too many open files: raise the limit (ulimit -n)";
    default: return "choose another path";
  }
}

std::string text_for(std::string_view kind, const std::filesystem::path& path, int error_number) {
  std::string text{"cannot write "};
  text.append(kind).append(" '").append(path.string()).append("': ");
  text += std::generic_category().message(error_number);
  return text.append("; ").append(fix_for(path, error_number));
}

}  // namespace

FileError::FileError(std::string_view kind, const std::filesystem::path& path, int error_number)
    : std::runtime_error(text_for(kind, path, error_number)), error_number_(error_number) {}

}  // namespace abs_hil::telemetry
