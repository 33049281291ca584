// Members of gzip files by zlib.
#include "study/gzip.hpp"

#include <zlib.h>

#include <array>
#include <stdexcept>
#include <utility>
#include <vector>

namespace abs_hil::study {

namespace {

constexpr int gzip_window = MAX_WBITS + 16;  // zlib's way to ask for gzip's header
constexpr int memory_level = 8;              // zlib's default
constexpr int system_unknown = 255;

Bytef* bytes_of(const char* text) { return reinterpret_cast<Bytef*>(const_cast<char*>(text)); }

struct Inflated {
  GzipMember member{};
  bool whole{false};  ///< the bytes are one member
};

/// @param flush  of zlib: how far it reads
Inflated inflated(std::string_view bytes, int flush) {
  z_stream stream{};
  if (inflateInit2(&stream, gzip_window) != Z_OK) throw std::runtime_error("zlib cannot start to read");
  std::vector<char> note(bytes.size() + 1);
  gz_header header{};
  header.name = bytes_of(note.data());
  header.name_max = static_cast<uInt>(bytes.size());
  inflateGetHeader(&stream, &header);
  Inflated result;
  std::array<char, 65'536> block{};
  stream.next_in = bytes_of(bytes.data());
  stream.avail_in = static_cast<uInt>(bytes.size());
  int status = Z_OK;
  do {
    stream.next_out = bytes_of(block.data());
    stream.avail_out = static_cast<uInt>(block.size());
    status = inflate(&stream, flush);
    result.member.content.append(block.data(), block.size() - stream.avail_out);
  } while (status == Z_OK && flush == Z_NO_FLUSH);
  result.whole = status == Z_STREAM_END && stream.avail_in == 0;
  if (header.done == 1) result.member.note = note.data();
  inflateEnd(&stream);
  return result;
}

}  // namespace

std::string gzip_member(std::string_view content, const std::string& note) {
  z_stream stream{};
  if (deflateInit2(&stream, Z_BEST_SPEED, Z_DEFLATED, gzip_window, memory_level, Z_DEFAULT_STRATEGY) != Z_OK) {
    throw std::runtime_error("zlib cannot start to compress");
  }
  std::string text = note;  // zlib takes a pointer that may write
  gz_header header{};
  header.os = system_unknown;
  header.name = bytes_of(text.data());
  deflateSetHeader(&stream, &header);
  std::string packed(deflateBound(&stream, content.size()) + note.size(), '\0');
  stream.next_in = bytes_of(content.data());
  stream.avail_in = static_cast<uInt>(content.size());
  stream.next_out = bytes_of(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  const int status = deflate(&stream, Z_FINISH);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  if (status != Z_STREAM_END) throw std::runtime_error("zlib cannot compress the results");
  return packed;
}

std::string gzip_note(std::string_view bytes) {
  const Inflated header = inflated(bytes, Z_BLOCK);  // ends behind the header
  if (header.member.note.empty()) throw std::runtime_error("no gzip file with a note");
  return header.member.note;
}

GzipMember read_gzip_member(std::string_view bytes) {
  Inflated all = inflated(bytes, Z_NO_FLUSH);
  if (!all.whole) throw std::runtime_error("damaged or cut off");
  return std::move(all.member);
}

}  // namespace abs_hil::study
