#pragma once

#include <stdexcept>
#include <string>

#include "rig/formatted_text.hpp"

namespace abs_hil::config {

/// The configuration cannot be used. The message is one line. It names the thing, the value, what is valid and where
/// the value came from. The program then ends with status 2, before anything has moved.
class ConfigError : public std::runtime_error {
 public:
  explicit ConfigError(const std::string& what) : std::runtime_error(rig::clean_text(what, 4000, "\n")) {}
};

}  // namespace abs_hil::config
