#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace abs_hil::rig {

/// Makes somebody else's text fit to show: valid UTF-8 without control characters, at most `most_characters`, with an
/// ellipsis in place of the rest. Invalid bytes and control characters, but those in `kept`, become U+FFFD. Not
/// real-time safe.
[[nodiscard]] std::string clean_text(std::string_view text, std::size_t most_characters = 200,
                                     std::string_view kept = {});

/// True if `text` is valid UTF-8 (RFC 3629).
[[nodiscard]] bool is_utf8(std::string_view text);

}  // namespace abs_hil::rig
