#include "abs_hil/driver/factory.hpp"

#include <array>

namespace abs_hil::driver {

std::span<const BackendEntry> backends() noexcept {
  static constexpr std::array<BackendEntry, 2> entries{{
      {"sim", "the simulated rig, at the level of encoder counts and duty cycles"},
      {"rig", "the real rig, behind the board that driver.kind names"},
  }};
  return entries;
}

std::unique_ptr<RigDriver> make_rig_driver(const DriverOptions& options) {
  throw Unavailable("backend rig: driver.kind = \"" + options.kind +
                    "\": this build drives no board yet; use --backend sim");
}

}  // namespace abs_hil::driver
