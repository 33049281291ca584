// What ResultFile does alike on every platform: it gathers what is written, and hands it on in large pieces.
#include "files/result_file.hpp"

namespace abs_hil::files {

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
