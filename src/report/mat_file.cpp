#include "report/mat_file.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>

namespace abs_hil::report::mat {

static_assert(std::endian::native == std::endian::little,
              "the file holds the processor's byte order, declared as little-endian");

namespace {

enum Type : std::uint32_t { int8 = 1, uint16 = 4, int32 = 5, uint32 = 6, float64 = 9, matrix = 14 };
enum Class : std::uint32_t { cell = 1, structure = 2, characters = 4, doubles = 6 };

constexpr std::size_t header_text_bytes = 116;
constexpr std::size_t field_name_bytes = 64;  ///< including the final zero

template <typename Value>
void append(std::string& bytes, Value value) {
  std::array<char, sizeof(Value)> raw{};
  std::memcpy(raw.data(), &value, sizeof(Value));
  bytes.append(raw.data(), raw.size());
}

/// Appends tag, data, and zeros up to a multiple of eight bytes.
void append_element(std::string& bytes, Type type, std::string_view data) {
  append(bytes, static_cast<std::uint32_t>(type));
  append(bytes, static_cast<std::uint32_t>(data.size()));
  bytes += data;
  bytes.append((8 - data.size() % 8) % 8, '\0');
}

std::string beginning(Class kind, std::size_t rows, std::size_t columns, std::string_view name) {
  std::string flags;
  append(flags, static_cast<std::uint32_t>(kind));
  append(flags, std::uint32_t{0});
  std::string dimensions;
  append(dimensions, static_cast<std::int32_t>(rows));
  append(dimensions, static_cast<std::int32_t>(columns));
  std::string bytes;
  append_element(bytes, uint32, flags);
  append_element(bytes, int32, dimensions);
  append_element(bytes, int8, name);
  return bytes;
}

std::string whole(const std::string& content) {
  std::string bytes;
  bytes.reserve(content.size() + 8);
  append_element(bytes, matrix, content);
  return bytes;
}

bool is_ascii_word(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
}

}  // namespace

std::string header() {
  std::string bytes = "MATLAB 5.0 MAT-file, written by abs_report";
  bytes.resize(header_text_bytes, ' ');
  bytes.append(8, '\0');  // no subsystem data
  append(bytes, std::uint16_t{0x0100});
  return bytes + "IM";
}

std::string column(std::string_view name, std::span<const double> values) {
  std::string data(values.size_bytes(), '\0');
  if (!values.empty()) std::memcpy(data.data(), values.data(), values.size_bytes());
  std::string bytes = beginning(doubles, values.size(), 1, name);
  append_element(bytes, float64, data);
  return whole(bytes);
}

std::string text(std::string_view name, std::string_view value) {
  std::string data;
  std::size_t count = 0;
  for (const char c : value) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte >= 0x80U && byte < 0xC0U) continue;  // a continuation byte of a multi-byte character
    append(data, static_cast<std::uint16_t>(byte < 0x80U ? byte : '?'));
    ++count;
  }
  std::string bytes = beginning(characters, count == 0 ? 0 : 1, count, name);
  append_element(bytes, uint16, data);
  return whole(bytes);
}

std::string texts(std::string_view name, const std::vector<std::string>& values) {
  std::string bytes = beginning(cell, 1, values.size(), name);
  for (const std::string& value : values) bytes += text("", value);
  return whole(bytes);
}

std::string structs(std::string_view name, const std::vector<std::string>& names,
                    const std::vector<std::string>& fields) {
  std::string bytes = beginning(structure, 1, names.empty() ? 0 : fields.size() / names.size(), name);
  // The length of the names is a small data element: type and size share four bytes, and the value follows in four.
  append(bytes, static_cast<std::uint32_t>(4U << 16U | static_cast<std::uint32_t>(int32)));
  append(bytes, static_cast<std::int32_t>(field_name_bytes));
  std::string all_names;
  for (std::string field : names) {
    field.resize(field_name_bytes, '\0');
    all_names += field;
  }
  append_element(bytes, int8, all_names);
  for (const std::string& field : fields) bytes += field;
  return whole(bytes);
}

std::string field_name(std::string_view name) {
  std::string field(name.substr(0, field_name_bytes - 2));
  std::replace_if(
      field.begin(), field.end(), [](char c) { return !is_ascii_word(c); }, '_');
  if (field.empty() || field.front() == '_' || (field.front() >= '0' && field.front() <= '9')) field.insert(0, 1, 'x');
  return field;
}

}  // namespace abs_hil::report::mat
