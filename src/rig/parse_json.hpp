#pragma once

#include <istream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "rig/nesting.hpp"

namespace abs_hil::rig {

/// JSON from outside. Throws nlohmann::json::parse_error, also for a text that nests too deep, before any value of it
/// is made.
template <class Json = nlohmann::json>
[[nodiscard]] Json parse_json(std::string_view text) {
  if (const auto place = too_deep_json(text)) {
    throw nlohmann::json::parse_error::create(
        101, *place, "nested deeper than " + std::to_string(nesting_max) + " levels; give a flatter text", nullptr);
  }
  return Json::parse(text);
}

template <class Json = nlohmann::json>
[[nodiscard]] Json parse_json(std::istream& in) {
  return parse_json<Json>(std::string(std::istreambuf_iterator<char>(in), {}));
}

/// A discarded value instead of an exception.
template <class Json = nlohmann::json>
[[nodiscard]] Json parse_json_if_valid(std::string_view text) {
  return too_deep_json(text) ? Json(nlohmann::json::value_t::discarded) : Json::parse(text, nullptr, false);
}

}  // namespace abs_hil::rig
