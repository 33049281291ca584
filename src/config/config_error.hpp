#pragma once

#include <stdexcept>

namespace abs_hil::config {

/// The configuration cannot be used. The message is one line that names the thing, the value, what is valid and where
/// it came from; the program ends with status 2 and nothing has moved.
class ConfigError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace abs_hil::config
