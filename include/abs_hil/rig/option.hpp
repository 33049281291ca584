#pragma once

#include <array>
#include <cstddef>
#include <initializer_list>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "abs_hil/rig/range.hpp"

// Options of the configuration. Each one is a single row, which is the member of its room's struct as well:
//
//   struct RelayOptions {
//     ABS_HIL_OPTIONS(RelayOptions);
//     ABS_HIL_OPTION(double, threshold, 0.0447, .meaning = "slip that releases the brake", .range =
//     rig::from_zero(0.99));
//   };
//
// The struct stays an aggregate, and reading an option is reading a member. Everything else is made from the rows: the
// configuration's keys with their lists, files and schemas, checks of ranges, what may change during a run, and what a
// search for gains may set.

namespace abs_hil::rig {

/// The names that a text may be; none: any text.
class AllowedNames {
 public:
  /// Name number `index`; empty beyond the last.
  using NameAt = std::string_view (*)(std::size_t index) noexcept;

  constexpr AllowedNames() noexcept = default;
  consteval AllowedNames(std::initializer_list<std::string_view> names) {
    std::size_t index = 0;
    for (const std::string_view name : names) names_[index++] = name;
  }
  /// For names that another table holds, or that only the running program knows.
  constexpr AllowedNames(NameAt name_at) noexcept : name_at_{name_at} {}

  [[nodiscard]] constexpr std::string_view at(std::size_t index) const noexcept {
    if (name_at_ != nullptr) return name_at_(index);
    return index < names_.size() ? names_[index] : std::string_view{};
  }
  [[nodiscard]] constexpr bool empty() const noexcept { return at(0).empty(); }
  [[nodiscard]] std::vector<std::string_view> list() const;
  /// True if the name is one of them, or any text will do.
  [[nodiscard]] bool contains(std::string_view name) const noexcept;

 private:
  std::array<std::string_view, 6> names_{};
  NameAt name_at_{nullptr};
};

/// What is to be known of an option beside its type, its name and its default.
struct OptionFacts {
  std::string_view key{};      ///< its name in the configuration; empty: that of the member
  std::string_view unit{};     ///< empty for pure numbers, flags and texts
  std::string_view meaning{};  ///< in a line
  Range range{};               ///< of numbers
  AllowedNames allowed{};      ///< of texts
  SearchRange search{};        ///< where abs_tune looks for a gain; nowhere by default
  bool start_value{false};     ///< where slip control begins: without effect once it has
};

/// One row: the member of `Struct` that holds the option, and what is to be known of it.
template <class Struct, class Value>
struct OptionRow {
  Value Struct::*member;
  OptionFacts facts;
};

/// One member of `Struct` that holds options of its own.
template <class Struct, class Group>
struct GroupRow {
  Group Struct::*member;
  std::string_view prefix;  ///< of its options' names: "observer."; empty: they stand beside those of `Struct`
  bool searched{true};      ///< false: the ranges for a search, which the rows give, do not count here
};

template <class Row>
inline constexpr bool is_group_row = false;
template <class Struct, class Group>
inline constexpr bool is_group_row<GroupRow<Struct, Group>> = true;

/// How a group takes part: its prefix, and whether a search may set its options.
struct GroupUse {
  std::string_view prefix;
  bool searched{true};
  constexpr GroupUse(const char* its_prefix, bool is_searched = true) noexcept
      : prefix{its_prefix}, searched{is_searched} {}
};
[[nodiscard]] constexpr GroupUse not_searched(const char* prefix) noexcept { return {prefix, false}; }

template <class Struct, class Value>
[[nodiscard]] constexpr OptionRow<Struct, Value> make_row(Value Struct::*member, std::string_view name,
                                                          OptionFacts facts) noexcept {
  if (facts.key.empty()) facts.key = name;
  return {member, facts};
}
template <class Struct, class Group>
[[nodiscard]] constexpr GroupRow<Struct, Group> make_group_row(Group Struct::*member, const GroupUse& use) noexcept {
  return {member, use.prefix, use.searched};
}

/// Rows are told apart by the line that they stand in, counted from ABS_HIL_OPTIONS.
template <int line>
using RowLine = std::integral_constant<int, line>;
inline constexpr int most_row_lines = 128;

// NOLINTBEGIN(cppcoreguidelines-macro-usage, bugprone-macro-parentheses): they declare members.
/// Before the rows of a struct, whose own name is `type`.
#define ABS_HIL_OPTIONS(type) \
  using OptionOwner = type;   \
  static constexpr int option_line = __LINE__

/// One option: type, member, default; then what OptionFacts holds, as in `.unit = "s", .range = rig::positive(60)`.
/// The types are double, std::int32_t, std::int64_t, bool and std::string.
#define ABS_HIL_OPTION(type, member, standard, ...)                                                 \
  static constexpr auto option_row(::abs_hil::rig::RowLine<__LINE__ - option_line>) noexcept {      \
    return ::abs_hil::rig::make_row(&OptionOwner::member, #member, {__VA_ARGS__});                  \
  }                                                                                                 \
  static_assert(__LINE__ - option_line < ::abs_hil::rig::most_row_lines, "too many lines of rows"); \
  type member = standard

/// A member with options of its own: type, member, prefix of its keys (or `rig::not_searched(prefix)`), and the braces
/// that it is initialised with.
#define ABS_HIL_GROUP(type, member, use, ...)                                                       \
  static constexpr auto option_row(::abs_hil::rig::RowLine<__LINE__ - option_line>) noexcept {      \
    return ::abs_hil::rig::make_group_row(&OptionOwner::member, use);                               \
  }                                                                                                 \
  static_assert(__LINE__ - option_line < ::abs_hil::rig::most_row_lines, "too many lines of rows"); \
  type member __VA_ARGS__
// NOLINTEND(cppcoreguidelines-macro-usage, bugprone-macro-parentheses)

/// Calls `visit` with each row of `Options`, in their order.
template <class Options, class Visit>
constexpr void for_each_row(const Visit& visit) {
  const auto visit_line = [&visit](auto line) {
    if constexpr (requires { Options::option_row(line); }) visit(Options::option_row(line));
  };
  [&visit_line]<int... line>(std::integer_sequence<int, line...>) {
    (visit_line(RowLine<line>{}), ...);
  }(std::make_integer_sequence<int, most_row_lines>{});
}

/// Calls `visit(name, facts, value)` for each option, those of groups included, in their order. Not real-time safe.
/// @param prefix before every name
template <class Options, class Visit>
void for_each_option(Options& options, const std::string& prefix, const Visit& visit, bool searched = true) {
  for_each_row<std::remove_const_t<Options>>([&](const auto& row) {
    if constexpr (is_group_row<std::remove_cvref_t<decltype(row)>>) {
      for_each_option(options.*row.member, prefix + std::string(row.prefix), visit, searched && row.searched);
    } else {
      OptionFacts facts = row.facts;
      if (!searched) facts.search = {};
      visit(prefix + std::string(facts.key), facts, options.*row.member);
    }
  });
}

}  // namespace abs_hil::rig
