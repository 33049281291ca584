#pragma once

#include <toml++/toml.h>

#include <istream>
#include <iterator>
#include <memory>
#include <string>
#include <string_view>

#include "rig/nesting.hpp"

namespace abs_hil::rig {

/// TOML from outside. Throws toml::parse_error, also for a text that nests too deep, before any value of it is made.
[[nodiscard]] inline toml::table parse_toml(std::string_view text, const std::string& path) {
  if (const auto deep = too_deep_toml(text)) {
    const auto line = static_cast<toml::source_index>(deep->line);
    const std::size_t begin = text.rfind('\n', deep->offset) + 1;  // npos + 1 is 0
    const toml::source_position at{line, static_cast<toml::source_index>(deep->offset - begin + 1)};
    const toml::source_region region{at, at, std::make_shared<const std::string>(path)};
    const std::string what = deep->name ? "a name has more than " + std::to_string(name_parts_max) + " parts"
                                        : "nested deeper than " + std::to_string(nesting_max) + " levels";
    throw toml::parse_error(what.c_str(), region);
  }
  return toml::parse(text, path);
}

/// The whole content of an open file.
[[nodiscard]] inline toml::table parse_toml(std::istream& in, const std::string& path) {
  return parse_toml(std::string(std::istreambuf_iterator<char>(in), {}), path);
}

}  // namespace abs_hil::rig
