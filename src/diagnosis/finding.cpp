// Findings of `doctor` and `latency` as text and as JSON.
#include "diagnosis/finding.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

namespace abs_hil::diagnosis {

namespace {

/// `text` with every line indented.
std::string indented(std::string_view text, std::string_view indent) {
  std::string out(indent);
  for (const char c : text) {
    out += c;
    if (c == '\n') out += indent;
  }
  return out;
}

/// A standing's mark in a text, and its name.
struct StandingWords {
  std::string_view mark;
  std::string_view name;
};
StandingWords words_of(Standing standing) {
  constexpr std::array<StandingWords, 4> rows{
      {{"ok  ", "ok"}, {"note", "note"}, {"WARN", "warning"}, {"FAIL", "failure"}}};
  return rows[static_cast<std::size_t>(standing)];
}

}  // namespace

std::string to_text(std::span<const Finding> findings) {
  std::string text;
  for (const Finding& f : findings) {
    text += fmt::format("{}  {}{}{}\n", words_of(f.standing).mark, f.what, f.detail.empty() ? "" : ": ", f.detail);
    if (!f.fix.empty()) text += fmt::format("      fix:\n{}\n", indented(f.fix, "        "));
  }
  return text;
}

nlohmann::ordered_json to_json(std::span<const Finding> findings) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Finding& f : findings) {
    list.push_back({{"check", f.check},
                    {"what", f.what},
                    {"standing", std::string(words_of(f.standing).name)},
                    {"detail", f.detail},
                    {"fix", f.fix}});
  }
  return list;
}

Standing worst(std::span<const Finding> findings) noexcept {
  Standing result = Standing::good;
  for (const Finding& f : findings) result = std::max(result, f.standing);
  return result;
}

}  // namespace abs_hil::diagnosis
