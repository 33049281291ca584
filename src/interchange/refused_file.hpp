#pragma once

#include <fmt/format.h>

#include <filesystem>
#include <stdexcept>
#include <string>

namespace abs_hil::interchange {

/// Refuses a file, whose name begins the message. Throws std::invalid_argument.
[[noreturn]] inline void refuse(const std::filesystem::path& file, const std::string& why) {
  throw std::invalid_argument(fmt::format("{}: {}", file.string(), why));
}

}  // namespace abs_hil::interchange
