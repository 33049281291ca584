#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace abs_hil::rig {

/// Levenshtein distance of two names. A text of more than 200 bytes is no name, and as far from another as it is long.
[[nodiscard]] inline std::size_t edit_distance(std::string_view a, std::string_view b) {
  constexpr std::size_t longest_name = 200;
  if (std::max(a.size(), b.size()) > longest_name) return std::max(a.size(), b.size());
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substituted = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, substituted});
    }
  }
  return row[b.size()];
}

/// The element of `names` that is nearest to `name`; empty if `names` is empty.
template <typename Names>
[[nodiscard]] std::string_view nearest_name(std::string_view name, const Names& names) {
  std::string_view best;
  std::size_t least = std::string_view::npos;
  for (const std::string_view candidate : names) {
    const std::size_t distance = edit_distance(name, candidate);
    if (distance < least) {
      least = distance;
      best = candidate;
    }
  }
  return best;
}

/// "; the nearest is NAME" for an unknown name that looks like one of `names`: it begins one, or at most half of its
/// letters differ. Otherwise empty, since a name that is not like it would only mislead.
template <typename Names>
[[nodiscard]] std::string nearest_hint(std::string_view name, const Names& names) {
  for (const std::string_view candidate : names) {
    if (name.size() > 2 && candidate.starts_with(name)) return "; the nearest is " + std::string(candidate);
  }
  const std::string_view nearest = nearest_name(name, names);
  if (nearest.empty() || 2 * edit_distance(name, nearest) > name.size()) return {};
  return "; the nearest is " + std::string(nearest);
}

/// Suggestions for the unknown dotted key `name`, which may lack its first parts. A tail is a whole key or the text
/// after one of its dots. The result is the keys with `name` as a tail; or else up to three keys with a tail that
/// begins with `name`; or else the keys with the nearest tail.
[[nodiscard]] inline std::vector<std::string_view> nearest_keys(std::string_view name,
                                                                const std::vector<std::string_view>& keys) {
  std::vector<std::string_view> nearest, begun;
  std::size_t least = std::string_view::npos;
  for (const std::string_view key : keys) {
    std::size_t distance = std::string_view::npos;
    bool begins = false;
    for (std::size_t start = 0; start != std::string_view::npos; start = key.find('.', start)) {
      if (start > 0) ++start;
      const std::string_view tail = key.substr(start);
      distance = std::min(distance, edit_distance(name, tail));
      begins = begins || (name.size() > 1 && tail.substr(0, name.size()) == name);
    }
    if (begins) begun.push_back(key);
    if (distance < least) nearest.clear();
    if (distance <= least) nearest.push_back(key);
    least = std::min(least, distance);
  }
  constexpr std::size_t readable = 3;
  if (least == 0 || begun.empty()) return nearest;
  if (begun.size() <= readable) return begun;
  return {nearest_name(name, begun)};
}

}  // namespace abs_hil::rig
