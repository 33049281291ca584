#include "analysis/result_file.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <utility>

namespace abs_hil::analysis {

ResultFile::ResultFile(std::filesystem::path path, std::string what)
    : path_(std::move(path)), part_(path_), what_(std::move(what)) {
  part_ += ".part";
  std::error_code ignored;
  const bool is_directory = std::filesystem::is_directory(path_, ignored);
  errno = 0;
  if (is_directory || !std::ofstream(part_)) {
    throw std::runtime_error(
        fmt::format("cannot write {} to \"{}\": {}; give a path in an existing, writable directory", what_,
                    path_.string(), is_directory ? "it is a directory" : std::strerror(errno)));
  }
}

ResultFile::~ResultFile() {
  std::error_code ignored;
  std::filesystem::remove(part_, ignored);
}

void ResultFile::write(std::string_view text) {
  errno = 0;
  std::ofstream file(part_, std::ios::binary);
  file << text;
  file.close();
  std::error_code error;
  if (file) std::filesystem::rename(part_, path_, error);
  if (!file || error) {
    throw std::runtime_error(fmt::format("cannot write {} to \"{}\": {}", what_, path_.string(),
                                         error ? error.message() : std::strerror(errno)));
  }
}

}  // namespace abs_hil::analysis
