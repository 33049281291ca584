// Members of gzip files, each with a note in its header.
#pragma once

#include <string>
#include <string_view>

namespace abs_hil::study {

/// One member of a gzip file. Members after each other are a gzip file, too, which every reader takes for one. The same
/// arguments give the same bytes with the same version of zlib: there is no time in it.
/// @param note  kept in the member's header, where readers of the content do not see it; without NUL. It stands in the
///   field for a file's name: DuckDB refuses a header with a comment.
[[nodiscard]] std::string gzip_member(std::string_view content, const std::string& note);

/// The note of the first member. @param bytes  the beginning of a gzip file, at least its first header
/// Throws std::runtime_error for anything else, and for a header without note.
[[nodiscard]] std::string gzip_note(std::string_view bytes);

struct GzipMember {
  std::string note{};
  std::string content{};
};
/// Reads a file's content that is one whole member. Throws std::runtime_error, without a path, for anything else and
/// for a wrong checksum.
[[nodiscard]] GzipMember read_gzip_member(std::string_view bytes);

}  // namespace abs_hil::study
