#pragma once

#include <string>
#include <string_view>

namespace abs_hil::telemetry {

/// Result of a check whether LCM can use a URL on this computer. It runs before LCM, whose own error text misleads.
struct RouteProbe {
  bool usable{false};
  std::string problem;  ///< one line; empty if usable
  std::string fix;      ///< commands or advice, lines without a final line end; empty if nothing needs a fix
};

/// For udpm, asks the kernel for a route by a UDP connect(), which sends nothing. Other providers count as usable,
/// because a check would have side effects; `fix` names what they need. Throws only std::bad_alloc.
[[nodiscard]] RouteProbe probe_lcm_route(std::string_view url);

}  // namespace abs_hil::telemetry
