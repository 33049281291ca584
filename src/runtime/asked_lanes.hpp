#pragma once

#include <type_traits>

#include "abs_hil/rig/scalar.hpp"

/// For code that goes on only `if (rig::any(asked))`. A single run then knows that the condition holds, so nothing is
/// left to ask. In a pack it holds in some lanes alone. All functions are real-time safe.
namespace abs_hil::runtime {

/// `asked && answer`.
template <class Condition>
[[nodiscard, gnu::always_inline]] constexpr Condition where_asked(const Condition& asked,
                                                                  const Condition& answer) noexcept {
  if constexpr (std::is_same_v<Condition, bool>) {
    return answer;
  } else {
    return asked && answer;
  }
}

/// `asked ? a : b`.
template <class Condition, class S>
[[nodiscard, gnu::always_inline]] constexpr S where_asked(const Condition& asked, const S& a, const S& b) noexcept {
  if constexpr (std::is_same_v<Condition, bool>) {
    return a;
  } else {
    return rig::select(asked, a, b);
  }
}

}  // namespace abs_hil::runtime
