// Makes bytes from elsewhere fit to show: valid UTF-8 without control characters.
#include "rig/clean_text.hpp"

#include <algorithm>
#include <cstdint>

namespace abs_hil::rig {

namespace {

constexpr std::string_view replacement = "\uFFFD";

bool is_continuation(char c) { return (static_cast<unsigned char>(c) & 0xC0U) == 0x80U; }

/// Number of bytes of the first character of `text`; 0 if it is invalid (RFC 3629, section 4).
std::size_t character_bytes(std::string_view text) {
  const auto first = static_cast<unsigned char>(text[0]);
  std::size_t size = 0;
  std::uint32_t code = 0;
  std::uint32_t least = 0;
  if (first < 0x80U) return 1;
  if (first >= 0xC2U && first < 0xE0U) {
    size = 2, code = first & 0x1FU, least = 0x80U;
  } else if (first >= 0xE0U && first < 0xF0U) {
    size = 3, code = first & 0x0FU, least = 0x800U;
  } else if (first >= 0xF0U && first < 0xF5U) {
    size = 4, code = first & 0x07U, least = 0x10000U;
  } else {
    return 0;
  }
  if (text.size() < size) return 0;
  for (std::size_t i = 1; i < size; ++i) {
    if (!is_continuation(text[i])) return 0;
    code = (code << 6U) | (static_cast<unsigned char>(text[i]) & 0x3FU);
  }
  const bool surrogate = code >= 0xD800U && code < 0xE000U;
  return code < least || surrogate || code > 0x10FFFFU ? 0 : size;
}

/// C0, DEL, C1, and marks that change the direction of writing, which can disguise text.
bool is_control(std::string_view character) {
  const auto first = static_cast<unsigned char>(character[0]);
  if (character.size() == 1) return first < 0x20U || first == 0x7FU;
  if (character.size() == 2) return first == 0xC2U && static_cast<unsigned char>(character[1]) < 0xA0U;
  return (character >= "\u200E" && character <= "\u200F") || (character >= "\u2028" && character <= "\u202E") ||
         (character >= "\u2066" && character <= "\u2069");
}

}  // namespace

std::string clean_text(std::string_view text, std::size_t most_characters, std::string_view kept) {
  std::string clean;
  std::size_t characters = 0;
  while (!text.empty()) {
    if (characters++ == most_characters) return clean + "\u2026";
    const std::size_t bytes = character_bytes(text);
    const std::string_view character = text.substr(0, std::max<std::size_t>(bytes, 1));
    const bool shown = bytes > 0 && (!is_control(character) || kept.find(character) != kept.npos);
    clean += shown ? character : replacement;
    text.remove_prefix(character.size());
  }
  return clean;
}

bool is_utf8(std::string_view text) {
  while (!text.empty()) {
    const std::size_t bytes = character_bytes(text);
    if (bytes == 0) return false;
    text.remove_prefix(bytes);
  }
  return true;
}

}  // namespace abs_hil::rig
