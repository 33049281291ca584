#pragma once

#include <span>
#include <string>
#include <string_view>

#include "config/script.hpp"
#include "config/settings.hpp"

namespace abs_hil::config {

/// Something of the simulated plant that events may change while it runs.
struct ChangingPart {
  std::string_view what;                                ///< key of an event: "friction"
  std::string_view in_words;                            ///< "friction of the road"
  std::string& (*profile)(config::Settings& settings);  ///< the configuration value that says how it goes
};
[[nodiscard]] std::span<const ChangingPart> changing_parts() noexcept;

/// How the events let one of the changing parts go, as its configuration value has it
/// ("braking time: 1; 0.5 at 0.6; 1 from 1 to 3"); empty: they leave it alone. Throws config::ConfigError, naming
/// line and column, for events that do not go together.
[[nodiscard]] std::string profile(const Script& script, std::string_view what);

}  // namespace abs_hil::config
