#include "report/text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>

namespace abs_hil::report {

namespace {

constexpr std::string_view replacement = "\uFFFD";
constexpr std::string_view minus = "\u2212";

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

/// Number of bytes, in whole characters, of the common beginning of two names; always less than the shorter one.
std::size_t common_bytes(std::string_view a, std::string_view b) {
  constexpr std::size_t left = 2;
  const std::size_t size = std::min(a.size(), b.size());
  std::size_t n = 0;
  while (n + left < size && a[n] == b[n]) ++n;
  while (n > 0 && is_continuation(a[n])) --n;
  return n;
}

std::string with_minus(std::string text) {
  if (text.starts_with('-')) text.replace(0, 1, minus);
  if (const auto exponent = text.find("e-"); exponent != std::string::npos) text.replace(exponent + 1, 1, minus);
  return text;
}

}  // namespace

std::string clean_text(std::string_view text, std::size_t most_characters) {
  std::string clean;
  std::size_t characters = 0;
  while (!text.empty()) {
    if (characters++ == most_characters) return clean + "\u2026";
    const std::size_t bytes = character_bytes(text);
    const std::string_view character = text.substr(0, std::max<std::size_t>(bytes, 1));
    clean += bytes == 0 || is_control(character) ? replacement : character;
    text.remove_prefix(character.size());
  }
  return clean;
}

std::vector<std::string> short_names(const std::vector<std::string>& names, std::size_t most_characters) {
  std::map<std::string, std::vector<std::size_t>> alike;
  std::vector<std::string> shorts;
  for (std::size_t i = 0; i < names.size(); ++i) {
    shorts.push_back(clean_text(names[i], most_characters));
    alike[shorts.back()].push_back(i);
  }
  for (const auto& [_, group] : alike) {
    if (group.size() == 1) continue;
    std::size_t begin = std::string::npos;
    for (const std::size_t i : group) begin = std::min(begin, common_bytes(names[group.front()], names[i]));
    for (const std::size_t i : group) shorts[i] = "\u2026" + clean_text(names[i].substr(begin), most_characters - 1);
  }
  return shorts;
}

std::string html_escape(std::string_view text) {
  std::string escaped;
  escaped.reserve(text.size());
  for (const char c : text) {
    switch (c) {
      case '&': escaped += "&amp;"; break;
      case '<': escaped += "&lt;"; break;
      case '>': escaped += "&gt;"; break;
      case '"': escaped += "&quot;"; break;
      case '\'': escaped += "&#39;"; break;
      default: escaped += c;
    }
  }
  return escaped;
}

std::string gnuplot_quote(std::string_view text) {
  std::string quoted = "'";
  for (const char c : text) {
    if (c == '\'') quoted += '\'';
    quoted += c;
  }
  return quoted + '\'';
}

std::string shown(double value, int decimals) {
  if (!std::isfinite(value)) return "–";
  std::string text = fmt::format("{:.{}f}", value, decimals);
  if (text.find_first_not_of("-0.") == std::string::npos && text.starts_with('-')) text.erase(0, 1);  // avoids "-0"
  return with_minus(std::move(text));
}

std::string shown_significant(double value, int digits) {
  return std::isfinite(value) ? with_minus(fmt::format("{:.{}g}", value, digits)) : "–";
}

std::size_t length_of(std::string_view utf8) {
  return static_cast<std::size_t>(std::count_if(utf8.begin(), utf8.end(), [](char c) { return !is_continuation(c); }));
}

}  // namespace abs_hil::report
