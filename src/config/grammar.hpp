#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abs_hil/rig/option.hpp"

// The tables of experiment and study files. Each is a struct whose keys are option rows (rig/option.hpp): a key is one
// row with its member, unit, range and meaning. The reader (config/reader.hpp), its errors and the JSON schema are made
// from the rows. The type of a member gives the form of its value.

namespace abs_hil::config {

/// The form of a key's value.
enum class Shape : std::uint8_t {
  text,       ///< any text; one of the allowed ones if the row names some
  flag_true,  ///< `true` alone
  number,     ///< a number with its unit, or "$key" for a configuration value
  whole,      ///< a whole number
  texts,      ///< a list of texts
  wholes,     ///< a list of whole numbers
  condition,  ///< "KEY = VALUE" over the configuration
  profile,    ///< a number, a table with a profile over the time of the phase, or an allowed text
  table,      ///< a table of `grammar`, or an allowed text
  tables,     ///< a list of such tables
  points,     ///< [[time, value], ...]
  settings,   ///< configuration values, nested or with dotted names
  factors,    ///< configuration values, each a list or a range
};

struct Grammar;

/// One key of a table.
struct Field {
  rig::OptionFacts facts;  ///< key without the unit's suffix; unit and range in SI units; allowed texts
  Shape shape{Shape::text};
  const Grammar& (*grammar)(){nullptr};  ///< of tables
  bool required{false};
};

/// One kind of table.
struct Grammar {
  std::string_view title;  ///< its name in errors: "[[phase]]"
  std::string_view meaning;
  std::vector<Field> fields{};

  [[nodiscard]] const Field* find(std::string_view name) const noexcept;
  /// All valid spellings: names with and without the unit's suffix.
  [[nodiscard]] std::vector<std::string> spellings() const;
};

/// The path from `start` down to the table that knows the key, "until" or "brake.slip_ref"; empty if none does.
[[nodiscard]] std::string table_below_with(const Grammar& start, std::string_view key);

// Units. A file gives the unit of a number in the key's name (`lasts_s = 2`) or after the number (`lasts = "2 s"`). The
// reader never guesses one.

/// The suffix of a key's name that gives this SI unit: "_rad_s" for "rad/s"; empty for pure numbers.
[[nodiscard]] std::string suffix_of(std::string_view unit);
/// The units that a number may have in place of this SI unit, as a list: "s, ms, min". Of pure numbers it is "%".
[[nodiscard]] std::string units_text(std::string_view unit);
/// Reads a number with its unit, "20 ms", and converts it to the SI unit. Returns nothing if the text has another form.
[[nodiscard]] std::optional<double> parse_quantity(std::string_view text, std::string_view unit) noexcept;

// ---- from the rows of a struct to its grammar

struct Number;
struct When;
struct ProfileScript;
struct ConditionScript;
struct Setting;
struct Factor;
/// Stands for `points` of a profile.
struct Points {};

/// A struct with rows that is a table of a file. It has a `title` and a `meaning`, and perhaps an array `required` of
/// keys without which it is not valid.
template <class T>
concept Table = requires {
  { T::title } -> std::convertible_to<std::string_view>;
};

/// The words of an enumeration in files; empty for what is no such enumeration.
template <class Enum>
using Word = std::pair<std::string_view, Enum>;
template <class Enum>
inline constexpr std::array<Word<Enum>, 0> words_of{};
template <class Enum>
[[nodiscard]] constexpr std::string_view word_at(std::size_t index) noexcept {
  return index < words_of<Enum>.size() ? words_of<Enum>.at(index).first : std::string_view{};
}

template <class T>
struct OptionalValue {
  using type = T;
};
template <class T>
struct OptionalValue<std::optional<T>> {
  using type = T;
};
template <class T>
struct ElementOf {
  using type = void;
};
template <class T>
struct ElementOf<std::vector<T>> {
  using type = T;
};

template <class T>
[[nodiscard]] const Grammar& grammar_of();

/// The field of a row whose member has the type `Member`.
template <class Member>
[[nodiscard]] Field field_of(const rig::OptionFacts& facts) {
  using Type = typename OptionalValue<Member>::type;
  using Element = typename ElementOf<Type>::type;
  Field field{.facts = facts};
  if constexpr (std::is_enum_v<Type>) {
    if (facts.allowed.empty()) field.facts.allowed = rig::AllowedNames(&word_at<Type>);
  } else if constexpr (std::is_same_v<Type, bool>) {
    field.shape = Shape::flag_true;
  } else if constexpr (std::is_integral_v<Type>) {
    field.shape = Shape::whole;
  } else if constexpr (std::is_same_v<Type, double> || std::is_same_v<Type, Number>) {
    field.shape = Shape::number;
  } else if constexpr (std::is_same_v<Type, When>) {
    field.shape = Shape::condition;
  } else if constexpr (std::is_same_v<Type, ProfileScript>) {
    field.shape = Shape::profile;
  } else if constexpr (std::is_same_v<Type, Points>) {
    field.shape = Shape::points;
  } else if constexpr (std::is_same_v<Element, std::string>) {
    field.shape = Shape::texts;
  } else if constexpr (std::is_same_v<Element, std::int64_t>) {
    field.shape = Shape::wholes;
  } else if constexpr (std::is_same_v<Element, Setting>) {
    field.shape = Shape::settings;
  } else if constexpr (std::is_same_v<Element, Factor>) {
    field.shape = Shape::factors;
  } else if constexpr (std::is_same_v<Element, ConditionScript>) {
    field.shape = Shape::table;
    field.grammar = &grammar_of<Element>;
  } else if constexpr (Table<Element>) {
    field.shape = Shape::tables;
    field.grammar = &grammar_of<Element>;
  } else if constexpr (Table<Type>) {
    field.shape = Shape::table;
    field.grammar = &grammar_of<Type>;
  } else {
    static_assert(std::is_same_v<Type, std::string>, "the reader knows no value of this type");
  }
  return field;
}

/// The grammar of a table. A struct whose keys come from elsewhere makes it itself.
template <class T>
const Grammar& grammar_of() {
  if constexpr (requires { T::grammar(); }) {
    return T::grammar();
  } else {
    static const Grammar grammar = [] {
      Grammar made{T::title, T::meaning};
      rig::for_each_row<T>([&made]<class Member>(const rig::OptionRow<T, Member>& row) {
        made.fields.push_back(field_of<Member>(row.facts));
        if constexpr (requires { T::required; }) {
          made.fields.back().required = std::ranges::find(T::required, row.facts.key) != T::required.end();
        }
      });
      return made;
    }();
    return grammar;
  }
}

}  // namespace abs_hil::config
