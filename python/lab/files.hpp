#pragma once

#include <string>

namespace abs_hil::lab {

/// From now on the file at `path` has this text.
void give_file(const std::string& path, std::string text);

}  // namespace abs_hil::lab
