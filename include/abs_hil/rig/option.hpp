#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "abs_hil/rig/range.hpp"

// Options of the configuration. Each option is one row, which also declares the member of its room's struct:
//
//   struct RelayOptions {
//     ABS_HIL_OPTIONS(RelayOptions);
//     ABS_HIL_OPTION(double, threshold, 0.0447, .meaning = "slip that releases the brake",
//                    .range = rig::from_zero(0.99));
//   };
//
// The struct stays an aggregate, and code reads an option as a member. The rows give everything else: the
// configuration's keys with their lists, files and schemas, the checks of ranges, the options that may change during a
// run, and those that a search for gains may set.

namespace abs_hil::rig {

/// The valid values of a text; none: any text is valid.
class AllowedNames {
 public:
  /// Name number `index`; empty beyond the last.
  using NameAt = std::string_view (*)(std::size_t index) noexcept;

  constexpr AllowedNames() noexcept = default;
  consteval AllowedNames(std::initializer_list<std::string_view> names) {
    std::size_t index = 0;
    for (const std::string_view name : names) names_[index++] = name;
  }
  /// For names from another table, or names that only the running program knows.
  constexpr AllowedNames(NameAt name_at) noexcept : name_at_{name_at} {}

  [[nodiscard]] constexpr std::string_view at(std::size_t index) const noexcept {
    if (name_at_ != nullptr) return name_at_(index);
    return index < names_.size() ? names_[index] : std::string_view{};
  }
  [[nodiscard]] constexpr bool empty() const noexcept { return at(0).empty(); }
  [[nodiscard]] std::vector<std::string_view> list() const;
  /// True if the name is one of them, or if any text is valid.
  [[nodiscard]] bool contains(std::string_view name) const noexcept;

 private:
  std::array<std::string_view, 6> names_{};
  NameAt name_at_{nullptr};
};

/// Endings of file names, each with its dot. A text that ends in one of them names a file.
struct FileEndings {
  /// In place of an ending: a class in Python, as in "my_laws:Gentle".
  static constexpr std::string_view python_class = "MODULE:CLASS";
  std::array<std::string_view, 4> endings{};
  [[nodiscard]] constexpr bool fit(std::string_view text) const noexcept {
    for (const std::string_view ending : endings) {
      if (ending == python_class ? is_python_class(text)
                                 : !ending.empty() && text.size() > ending.size() && text.ends_with(ending))
        return true;
    }
    return false;
  }
  /// Two names with a colon between them, letters, digits and '_', and dots in the first.
  [[nodiscard]] static constexpr bool is_python_class(std::string_view text) noexcept {
    const std::size_t colon = text.find(':');
    if (colon == 0 || colon == std::string_view::npos || colon + 1 == text.size()) return false;
    for (std::size_t i = 0; i < text.size(); ++i) {
      const char c = text[i];
      const bool of_a_name = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
      if (!of_a_name && i != colon && !(c == '.' && i < colon)) return false;
    }
    return true;
  }
};

/// How an option bears on the safety of a run on a real board. Values that weaken the protection need the consent of a
/// person there (config/board_policy.hpp); `abs_hil list --keys` shows all classes.
struct SafetyClass {
  enum class Kind : std::uint8_t {
    unclassed,     ///< nobody has judged the option
    none,          ///< no value weakens the protection
    above,         ///< values above `bound` do
    below,         ///< values below `bound` do
    unless,        ///< all values but `bound` do, or of texts all but `text`
    text,          ///< the value `text` does, "true" or "false" of flags
    commissioned,  ///< the board's commissioning record holds for one value alone
    elsewhere,     ///< a rule of its own judges the option on a board
    consent        ///< the option is such a consent
  };
  Kind kind{Kind::unclassed};
  double bound{0.0};
  std::string_view text{};
  std::string_view consent{};  ///< an option of `unsafe.` that consents, too

  [[nodiscard]] bool weakened_by(double value) const noexcept;
  [[nodiscard]] bool weakened_by(std::string_view value) const noexcept;
  /// The class in words; `unit` is the option's.
  [[nodiscard]] std::string in_words(std::string_view unit) const;
};
inline constexpr SafetyClass no_effect_on_safety{.kind = SafetyClass::Kind::none};
inline constexpr SafetyClass commissioned{.kind = SafetyClass::Kind::commissioned};
inline constexpr SafetyClass judged_elsewhere{.kind = SafetyClass::Kind::elsewhere};
[[nodiscard]] constexpr SafetyClass weaker_above(double bound, std::string_view consent = {}) noexcept {
  return {.kind = SafetyClass::Kind::above, .bound = bound, .consent = consent};
}
[[nodiscard]] constexpr SafetyClass weaker_below(double bound) noexcept {
  return {.kind = SafetyClass::Kind::below, .bound = bound};
}
[[nodiscard]] constexpr SafetyClass weaker_unless(double bound) noexcept {
  return {.kind = SafetyClass::Kind::unless, .bound = bound};
}
[[nodiscard]] constexpr SafetyClass weaker_unless(std::string_view text) noexcept {
  return {.kind = SafetyClass::Kind::unless, .text = text};
}
[[nodiscard]] constexpr SafetyClass weaker_if(std::string_view text) noexcept {
  return {.kind = SafetyClass::Kind::text, .text = text};
}

/// The facts of an option beside its type, its name and its default. Fields of scripts use it too.
struct OptionFacts {
  std::string_view key{};      ///< its name in the configuration; empty: that of the member
  std::string_view unit{};     ///< empty for pure numbers, flags and texts
  std::string_view meaning{};  ///< one line
  Range range{};               ///< of numbers
  AllowedNames allowed{};      ///< of texts
  FileEndings files{};         ///< of texts: beside the allowed names, a file whose name ends so
  SearchRange search{};        ///< where abs_tune looks for a gain; nowhere by default
  std::string_view on_rig{};   ///< of a rig's parameter: where to read it off the rig; empty for all others
  bool start_value{false};     ///< initial value of slip control: no effect after slip control has begun
  SafetyClass safety{};        ///< of an option that acts on a board

  /// True for an allowed name, for a file with one of the endings, and for any text if none is prescribed.
  [[nodiscard]] bool allows(std::string_view text) const noexcept { return allowed.contains(text) || files.fit(text); }
};

/// One row: the member of `Struct` that holds the option, and its facts.
template <class Struct, class Value>
struct OptionRow {
  Value Struct::*member;
  OptionFacts facts;
};

/// One member of `Struct` that is itself a struct of options.
template <class Struct, class Group>
struct GroupRow {
  Group Struct::*member;
  std::string_view prefix;  ///< of its options' names: "observer."; empty: the names have no prefix within `Struct`
  bool searched{true};      ///< false: the search ranges of the rows do not apply here
};

/// Use of a group: its prefix, and whether a search may set its options.
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

/// The line of a row, counted from ABS_HIL_OPTIONS, identifies it.
template <int line>
using RowLine = std::integral_constant<int, line>;
inline constexpr int most_row_lines = 128;

// NOLINTBEGIN(cppcoreguidelines-macro-usage, bugprone-macro-parentheses): they declare members.
/// Stands before the rows of a struct. `type` is the struct's name.
#define ABS_HIL_OPTIONS(type) \
  template <class Value>      \
  using OptionValue = Value;  \
  using OptionOwner = type;   \
  static constexpr int option_line = __LINE__

/// The same for a law that runs in lanes: its options of type double are members of type `scalar`.
#define ABS_HIL_LANE_OPTIONS(type, scalar) \
  template <class>                         \
  using OptionValue = scalar;              \
  using OptionOwner = type;                \
  static constexpr int option_line = __LINE__

/// One option: type, member, default, then members of OptionFacts, as in `.unit = "s", .range = rig::positive(60)`.
/// The types are double, std::int32_t, std::int64_t, bool and std::string.
#define ABS_HIL_OPTION(type, member, standard, ...)                                                 \
  static constexpr auto option_row(::abs_hil::rig::RowLine<__LINE__ - option_line>) noexcept {      \
    return ::abs_hil::rig::make_row(&OptionOwner::member, #member, {__VA_ARGS__});                  \
  }                                                                                                 \
  static_assert(__LINE__ - option_line < ::abs_hil::rig::most_row_lines, "too many lines of rows"); \
  OptionValue<type> member = standard

/// A member that is a struct of options: type, member, prefix of its keys (or `rig::not_searched(prefix)`), and its
/// initialiser in braces.
#define ABS_HIL_GROUP(type, member, use, ...)                                                       \
  static constexpr auto option_row(::abs_hil::rig::RowLine<__LINE__ - option_line>) noexcept {      \
    return ::abs_hil::rig::make_group_row(&OptionOwner::member, use);                               \
  }                                                                                                 \
  static_assert(__LINE__ - option_line < ::abs_hil::rig::most_row_lines, "too many lines of rows"); \
  type member __VA_ARGS__
// NOLINTEND(cppcoreguidelines-macro-usage, bugprone-macro-parentheses)

/// Calls `visit` with each row of `Options`, in order.
template <class Options, class Visit>
constexpr void for_each_row(const Visit& visit) {
  const auto visit_line = [&visit](auto line) {
    if constexpr (requires { Options::option_row(line); }) visit(Options::option_row(line));
  };
  [&visit_line]<int... line>(std::integer_sequence<int, line...>) {
    (visit_line(RowLine<line>{}), ...);
  }(std::make_integer_sequence<int, most_row_lines>{});
}

/// Where an option is kept, for code that does not know the struct of its row.
using OptionTarget = std::variant<double*, std::int32_t*, std::int64_t*, bool*, std::string*>;
using OptionVisitor =
    std::function<void(const std::string& name, const OptionFacts& facts, const OptionTarget& target)>;

/// A struct whose rows only the running program knows. It visits them itself.
template <class Options>
concept VisitsOwnOptions = requires(Options& options, const std::string& prefix, const OptionVisitor& visitor) {
  options.visit_options(prefix, visitor);
};

/// Calls `visit(name, facts, value)` for each option, including those of groups, in order. Not real-time safe.
/// @param prefix is put before every name
template <class Options, class Visit>
void for_each_option(Options& options, const std::string& prefix, const Visit& visit, bool searched = true) {
  using Mutable = std::remove_const_t<Options>;
  if constexpr (VisitsOwnOptions<Mutable>) {
    const_cast<Mutable&>(options).visit_options(
        prefix, [&visit, searched](const std::string& name, OptionFacts facts, const OptionTarget& target) {
          if (!searched) facts.search = {};
          std::visit(
              [&](auto* value) {
                if constexpr (std::is_const_v<Options>) {
                  visit(name, facts, std::as_const(*value));
                } else {
                  visit(name, facts, *value);
                }
              },
              target);
        });
  } else {
    for_each_row<Mutable>([&](const auto& row) {
      if constexpr (requires { row.searched; }) {
        for_each_option(options.*row.member, std::string(prefix).append(row.prefix), visit, searched && row.searched);
      } else {
        OptionFacts facts = row.facts;
        if (!searched) facts.search = {};
        visit(std::string(prefix).append(facts.key), facts, options.*row.member);
      }
    });
  }
}

}  // namespace abs_hil::rig
