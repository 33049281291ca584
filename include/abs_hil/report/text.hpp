#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace abs_hil::report {

/// Text from a file made fit to show: valid UTF-8 without control characters, at most `most_characters`, an ellipsis
/// where some were left out. What is not a character becomes U+FFFD.
[[nodiscard]] std::string clean_text(std::string_view text, std::size_t most_characters = 200);

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
