// Finds options that weaken a board's protection, and whether a person consented by a key.
#include "runtime/weak_values.hpp"

#include <algorithm>
#include <string_view>
#include <type_traits>

namespace abs_hil::runtime {

namespace {

/// True if a comma-separated list has this entry.
bool lists(std::string_view list, std::string_view entry) {
  for (std::size_t begin = 0; begin < list.size();) {
    const std::size_t end = std::min(list.find(',', begin), list.size());
    if (list.substr(begin, end - begin) == entry) return true;
    begin = end + 1;
  }
  return false;
}

/// The flag of `unsafe.` with this name.
bool consents(const UnsafeOptions& unsafe, std::string_view name) {
  bool given = false;
  rig::for_each_option(unsafe, {}, [&](const std::string& option, const rig::OptionFacts&, const auto& value) {
    if constexpr (std::is_same_v<std::remove_cvref_t<decltype(value)>, bool>) given |= option == name && value;
  });
  return given;
}

}  // namespace

bool has_consent(const WeakValue& weak, const UnsafeOptions& unsafe) {
  return lists(unsafe.keys, weak.key) || consents(unsafe, weak.consent);
}

}  // namespace abs_hil::runtime
