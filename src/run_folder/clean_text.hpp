#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace abs_hil::run_folder {

/// Makes text from a file fit to show: valid UTF-8 without control characters, at most `most_characters`, with an
/// ellipsis in place of the rest. Invalid bytes become U+FFFD.
[[nodiscard]] std::string clean_text(std::string_view text, std::size_t most_characters = 200);

}  // namespace abs_hil::run_folder
