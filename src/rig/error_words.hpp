// What the system and other programs say when they refuse something, with what a person can do: one table.
#pragma once

#include <string>
#include <string_view>

namespace abs_hil::rig {

/// What the program wanted of a place when the system refused it.
enum Deed : unsigned { writing = 1, reading = 2, starting = 4, reaching = 8 };

/// The system's words for an errno with what a person can do: "Permission denied; get the right ...".
/// @param place  the file, folder or program; of `reaching` the address, socket or device
[[nodiscard]] std::string refusal(int error, const std::string& place, Deed deed);

/// What a library or another program said, with cause and fix where the table knows its words, else with `otherwise`.
[[nodiscard]] std::string refusal(std::string_view words, const std::string& place, std::string_view otherwise = {});

}  // namespace abs_hil::rig
