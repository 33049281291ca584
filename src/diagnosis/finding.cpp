// Findings of `doctor` and `latency` as text and as JSON.
#include "diagnosis/finding.hpp"

#include <fmt/format.h>

#include <algorithm>
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

std::string_view mark(Standing standing) {
  switch (standing) {
    case Standing::good: return "ok  ";
    case Standing::note: return "note";
    case Standing::warning: return "WARN";
    case Standing::failure: return "FAIL";
  }
  return "?";
}

}  // namespace

std::string_view name_of(Standing standing) noexcept {
  switch (standing) {
    case Standing::good: return "ok";
    case Standing::note: return "note";
    case Standing::warning: return "warning";
    case Standing::failure: return "failure";
  }
  return "unknown";
}

std::string to_text(std::span<const Finding> findings) {
  std::string text;
  for (const Finding& f : findings) {
    text += fmt::format("{}  {}{}{}\n", mark(f.standing), f.what, f.detail.empty() ? "" : ": ", f.detail);
    if (!f.fix.empty()) text += fmt::format("      fix:\n{}\n", indented(f.fix, "        "));
  }
  return text;
}

nlohmann::ordered_json to_json(std::span<const Finding> findings) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Finding& f : findings) {
    list.push_back({{"check", f.check},
                    {"what", f.what},
                    {"standing", std::string(name_of(f.standing))},
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
