#pragma once

#include <string>

#include "runtime/unsafe_options.hpp"

namespace abs_hil::runtime {

/// An option whose value weakens the protection of a board (rig::SafetyClass).
struct WeakValue {
  std::string key{};
  std::string value{};
  std::string class_text{};  ///< "weakens above 250 rad/s"
  std::string consent{};     ///< an option of `unsafe.` that consents beside `unsafe.keys`; empty: none
  std::string meaning{};
};

/// True if a person has consented to the value: by its key in `unsafe.keys`, or by the flag that its row names.
[[nodiscard]] bool has_consent(const WeakValue& weak, const UnsafeOptions& unsafe);

}  // namespace abs_hil::runtime
