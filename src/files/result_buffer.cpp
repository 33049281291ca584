// What ResultFile and FileError do alike on every platform: texts of errors, and writing in large pieces.
#include "files/result_file.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::files {

FileError::FileError(std::string_view kind, const std::filesystem::path& path, int error_number)
    : FileError(kind, path, rig::refusal(error_number, path.string(), rig::writing), error_number) {}

FileError::FileError(std::string_view kind, const std::filesystem::path& path, std::string_view why, int error_number)
    : std::runtime_error(
          std::string("cannot write ").append(kind).append(" '").append(path.string()).append("': ").append(why)),
      error_number_(error_number) {}

void ResultFile::append(std::string_view bytes) {
  if (buffer_.size() + bytes.size() > buffer_bytes) flush();
  if (bytes.size() > buffer_bytes) return put(bytes);
  buffer_ += bytes;
}

void ResultFile::flush() {
  put(buffer_);
  buffer_.clear();
}

void ResultFile::write(std::string_view whole) {
  append(whole);
  commit();
}

void write_result(const std::filesystem::path& path, const std::string& kind, std::string_view bytes,
                  const std::filesystem::path& part_folder) {
  ResultFile(path, kind, part_folder).write(bytes);
}

}  // namespace abs_hil::files
