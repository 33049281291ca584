#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "abs_hil/driver/rig_driver.hpp"

namespace abs_hil::driver {

/// Everything below `driver.` in the configuration.
struct DriverOptions {
  std::string kind{"none"};  ///< the board behind `--backend rig`
};

struct BackendEntry {
  std::string_view name;
  std::string_view summary;
};
/// What `--backend` takes. The simulated one is made by `SimDriver` itself: only driver/sim knows the plant.
[[nodiscard]] std::span<const BackendEntry> backends() noexcept;

/// The real rig behind the board that `options.kind` names. Throws Unavailable, with what to do, if there is none.
[[nodiscard]] std::unique_ptr<RigDriver> make_rig_driver(const DriverOptions& options);

}  // namespace abs_hil::driver
