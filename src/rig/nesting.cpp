// Tells where a JSON or TOML text nests deeper than the parsers' stack allows.
#include "rig/nesting.hpp"

#include <algorithm>

namespace abs_hil::rig {

namespace {

/// The offset after a text in quotes that begins at `at`; the end of `text` if it is not closed.
std::size_t after_quotes(std::string_view text, std::size_t at, std::string_view quotes) noexcept {
  const bool escapes = quotes.front() == '"';
  for (std::size_t i = at + quotes.size(); i < text.size(); ++i) {
    if (escapes && text[i] == '\\') {
      ++i;
    } else if (text.substr(i, quotes.size()) == quotes) {
      return i + quotes.size();
    } else if (quotes.size() == 1 && text[i] == '\n') {
      return i;  // no text in single quotes goes beyond its line: an open one must not hide what follows
    }
  }
  return text.size();
}

bool opens(char c) noexcept { return c == '[' || c == '{'; }
bool closes(char c) noexcept { return c == ']' || c == '}'; }

}  // namespace

std::optional<std::size_t> too_deep_json(std::string_view text) noexcept {
  int depth = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '"') {
      i = after_quotes(text, i, "\"") - 1;
    } else if (opens(text[i])) {
      if (++depth > nesting_max) return i;
    } else if (closes(text[i])) {
      depth = std::max(0, depth - 1);
    }
  }
  return std::nullopt;
}

std::optional<TooDeepToml> too_deep_toml(std::string_view text) noexcept {
  int depth = 0;
  int parts = 1;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    const auto place = [&](bool name) {
      const auto line = 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(i), '\n');
      return TooDeepToml{.offset = i, .line = static_cast<std::size_t>(line), .name = name};
    };
    if (c == '"' || c == '\'') {
      const std::string_view three = text.substr(i, 3);
      i = after_quotes(text, i, three == R"(""")" || three == "'''" ? three : three.substr(0, 1)) - 1;
    } else if (c == '#') {
      i = std::min(text.find('\n', i), text.size()) - 1;
    } else if (c == '.') {
      if (++parts > name_parts_max) return place(true);
    } else if (c == '\n' || c == '=' || c == ',' || opens(c) || closes(c)) {
      parts = 1;
      if (opens(c) && ++depth > nesting_max) return place(false);
      if (closes(c)) depth = std::max(0, depth - 1);
    }
  }
  return std::nullopt;
}

}  // namespace abs_hil::rig
