#pragma once

#include <span>
#include <string>

#include "abs_hil/rig/reason.hpp"
#include "rig/controller_signal.hpp"

namespace abs_hil::rig {

/// A reason in words, with the name of what its value stands for if the value is an index. Not real-time safe.
/// @param own_signals  names of the controller's own signals, if known
[[nodiscard]] inline std::string reason_text(Reason reason, double value,
                                             std::span<const std::string> own_signals = {}) {
  std::string text(description(reason));
  if (reason == Reason::controller_not_finite) text.append(": ").append(controller_signal(value, own_signals));
  return text;
}

}  // namespace abs_hil::rig
