#pragma once

#include <string>
#include <string_view>

namespace abs_hil::telemetry {

/// Whether LCM can work with a URL on this computer, found out before LCM is asked, whose own text misleads.
struct RouteProbe {
  bool usable{false};
  std::string problem;  ///< one line; empty if usable
  std::string fix;      ///< commands or advice, lines without a final line end; empty if nothing is to be done
};

/// udpm: asks the kernel for a route by a UDP connect(), which sends nothing. Other providers are usable as far as can
/// be told without side effects; `fix` then says what they need. Never throws but std::bad_alloc.
[[nodiscard]] RouteProbe probe_lcm_route(std::string_view url);

}  // namespace abs_hil::telemetry
