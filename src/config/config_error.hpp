#pragma once

#include <stdexcept>

namespace abs_hil::config {

/// The configuration cannot be used. The message is one line. It names the thing, the value, what is valid and where
/// the value came from. The program then ends with status 2, before anything has moved.
class ConfigError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace abs_hil::config
