#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace abs_hil::report {

/// Text from a file made fit to show: valid UTF-8 without control characters, at most `most_characters`, an ellipsis
/// where some were left out. What is not a character becomes U+FFFD.
[[nodiscard]] std::string clean_text(std::string_view text, std::size_t most_characters = 200);

/// Names cleaned and cut to `most_characters` (at least 2) and an ellipsis. Those that would look alike then, as
/// folders named by the day do, lose what they have in common at their beginning instead: "2026-05-04-paper" and
/// "2026-05-07-paper" become "…4-paper" and "…7-paper".
[[nodiscard]] std::vector<std::string> short_names(const std::vector<std::string>& names, std::size_t most_characters);

/// For element content and quoted attributes of HTML: & < > " ' become references.
[[nodiscard]] std::string html_escape(std::string_view text);

/// A string constant of gnuplot in single quotes, in which gnuplot substitutes nothing: no commands, no variables.
[[nodiscard]] std::string gnuplot_quote(std::string_view text);

/// A number with a fixed count of decimals and a true minus sign; "–" for what is not a number.
[[nodiscard]] std::string shown(double value, int decimals);
/// A number with so many significant digits, a true minus sign; "–" for what is not a number.
[[nodiscard]] std::string shown_significant(double value, int digits);

/// Characters (code points) of valid UTF-8.
[[nodiscard]] std::size_t length_of(std::string_view utf8);

}  // namespace abs_hil::report
