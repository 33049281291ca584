#pragma once

#include <algorithm>
#include <cctype>
#include <charconv>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

namespace abs_hil::rig {

/// Formats text of any length as printf does. `format` must be a literal that fits the values. Not real-time safe.
template <typename... Values>
[[nodiscard]] std::string formatted(const char* format, Values... values) {
  const int size = std::snprintf(nullptr, 0, format, values...);
  std::string text(static_cast<std::size_t>(size > 0 ? size : 0), '\0');
  std::snprintf(text.data(), text.size() + 1, format, values...);
  return text;
}

/// `text` without the blanks at both ends.
[[nodiscard]] inline std::string_view trimmed(std::string_view text) noexcept {
  constexpr std::string_view blanks = " \t";
  text.remove_prefix(std::min(text.find_first_not_of(blanks), text.size()));
  return text.substr(0, text.find_last_not_of(blanks) + 1);
}

/// The parts between the separators, at least one.
[[nodiscard]] inline std::vector<std::string_view> split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  for (std::size_t begin = 0; begin <= text.size(); begin += parts.back().size() + 1) {
    parts.push_back(text.substr(begin, text.find(separator, begin) - begin));
  }
  return parts;
}

/// A field of CSV (RFC 4180), in quotes if it needs them.
[[nodiscard]] inline std::string csv_field(std::string_view text) {
  if (text.find_first_of(",\"\r\n") == std::string_view::npos) return std::string(text);
  std::string quoted = "\"";
  for (const char c : text) quoted.append(c == '"' ? 2 : 1, c);
  return quoted + '"';
}

/// The words with commas between them.
[[nodiscard]] inline std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text.append(text.empty() ? "" : ", ").append(word);
  return text;
}

/// FNV-1a, 64 bits: the same on every computer.
[[nodiscard]] constexpr std::uint64_t hash_of(std::string_view text) noexcept {
  std::uint64_t hash = 0xcbf29ce484222325U;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3U;
  return hash;
}

/// The text as a plain name: whatever is neither a letter or a digit of ASCII nor one of `also` becomes '_'.
[[nodiscard]] inline std::string plain_name(std::string text, std::string_view also) {
  const auto is_odd = [also](unsigned char c) {
    return std::isalnum(c) == 0 && also.find(static_cast<char>(c)) == also.npos;
  };
  std::ranges::replace_if(text, is_odd, '_');
  return text;
}

/// The whole text as a number, an integer in the base if one is given; nothing for any other text.
template <typename Number>
[[nodiscard]] std::optional<Number> parse_number(std::string_view text, std::same_as<int> auto... base) noexcept {
  Number value{};
  const auto [at, error] = std::from_chars(text.data(), text.data() + text.size(), value, base...);
  return error == std::errc() && at == text.data() + text.size() ? std::optional(value) : std::nullopt;
}

/// Makes somebody else's text fit to show: valid UTF-8 without control characters, at most `most_characters`, with an
/// ellipsis in place of the rest. Invalid bytes and control characters, but those in `kept`, become U+FFFD. Not
/// real-time safe.
[[nodiscard]] std::string clean_text(std::string_view text, std::size_t most_characters = 200,
                                     std::string_view kept = {});

/// True if `text` is valid UTF-8 (RFC 3629).
[[nodiscard]] bool is_utf8(std::string_view text);

/// What the program wanted of a place when the system refused it.
enum Deed : unsigned { writing = 1, reading = 2, starting = 4, reaching = 8 };

/// The system's words for an errno with what a person can do: "Permission denied; get the right ...".
/// @param place  the file, folder or program; of `reaching` the address, socket or device
[[nodiscard]] std::string refusal(int error, const std::string& place, Deed deed);

/// What a library or another program said, with cause and fix where the table knows its words, else with `otherwise`.
[[nodiscard]] std::string refusal(std::string_view words, const std::string& place, std::string_view otherwise = {});

}  // namespace abs_hil::rig
