#pragma once

#include <span>
#include <string>
#include <string_view>

#include "config/script.hpp"
#include "config/settings.hpp"

namespace abs_hil::config {

/// A part of the simulated plant that events may change during a run.
struct ChangingPart {
  std::string_view what;                                ///< key of an event: "friction"
  std::string_view in_words;                            ///< "friction of the road"
  std::string& (*profile)(config::Settings& settings);  ///< the configuration value with its profile
};
[[nodiscard]] std::span<const ChangingPart> changing_parts() noexcept;

/// The profile that the script's events give one of the changing parts, in the form of its configuration value
/// ("braking time: 1; 0.5 at 0.6; 1 from 1 to 3"). Empty: no event changes the part. Throws config::ConfigError with
/// line and column for events that contradict each other.
[[nodiscard]] std::string profile(const Script& script, std::string_view what);

}  // namespace abs_hil::config
