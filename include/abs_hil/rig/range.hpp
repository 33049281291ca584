#pragma once

#include <string>

namespace abs_hil::rig {

/// Interval of valid numbers. An end belongs to it unless it is open.
struct Range {
  double least{0.0};
  double most{0.0};
  bool least_open{false};
  bool most_open{false};
  /// False for NaN. Real-time safe.
  [[nodiscard]] constexpr bool contains(double value) const noexcept {
    return (least_open ? value > least : value >= least) && (most_open ? value < most : value <= most);
  }
  [[nodiscard]] std::string text() const;  ///< such as "(0, 1]"
};

[[nodiscard]] constexpr Range between(double least, double most) noexcept { return {least, most, false, false}; }
[[nodiscard]] constexpr Range open_between(double least, double most) noexcept { return {least, most, true, true}; }
[[nodiscard]] constexpr Range positive(double most) noexcept { return {0.0, most, true, false}; }
[[nodiscard]] constexpr Range from_zero(double most) noexcept { return {0.0, most, false, false}; }
[[nodiscard]] constexpr Range from_zero_below(double most) noexcept { return {0.0, most, false, true}; }
[[nodiscard]] constexpr Range negative(double least) noexcept { return {least, 0.0, false, true}; }

/// Interval in which a search for good values looks. There is no search unless least < most.
struct SearchRange {
  double least{0.0};
  double most{0.0};
  bool logarithmic{true};  ///< search over the logarithm: for gains of unknown order of magnitude
  [[nodiscard]] constexpr bool given() const noexcept { return least < most; }
};

[[nodiscard]] constexpr SearchRange search(double least, double most) noexcept { return {least, most, true}; }
[[nodiscard]] constexpr SearchRange search_linearly(double least, double most) noexcept { return {least, most, false}; }

}  // namespace abs_hil::rig
