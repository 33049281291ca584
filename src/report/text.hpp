#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace abs_hil::report {

/// Makes text from a file fit to show: valid UTF-8 without control characters, at most `most_characters`, with an
/// ellipsis in place of the rest. Invalid bytes become U+FFFD.
[[nodiscard]] std::string clean_text(std::string_view text, std::size_t most_characters = 200);

/// Cleans names and cuts them to `most_characters` (at least 2) with an ellipsis. Names that would then look alike,
/// such as folders named by date, lose their common beginning instead: "2026-05-04-paper" and "2026-05-07-paper" become
/// "…4-paper" and "…7-paper".
[[nodiscard]] std::vector<std::string> short_names(const std::vector<std::string>& names, std::size_t most_characters);

/// Escapes text for element content and quoted attributes of HTML: & < > " ' become references.
[[nodiscard]] std::string html_escape(std::string_view text);

/// A gnuplot string in single quotes, in which gnuplot substitutes neither commands nor variables.
[[nodiscard]] std::string gnuplot_quote(std::string_view text);

/// A number with fixed decimals and a true minus sign; "–" for NaN and infinity.
[[nodiscard]] std::string shown(double value, int decimals);
/// A number with `digits` significant digits and a true minus sign; "–" for NaN and infinity.
[[nodiscard]] std::string shown_significant(double value, int digits);

/// Number of characters (code points) in valid UTF-8.
[[nodiscard]] std::size_t length_of(std::string_view utf8);

}  // namespace abs_hil::report
