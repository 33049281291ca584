#pragma once

#include "abs_hil/control/options.hpp"
#include "abs_hil/rig/parameters.hpp"

namespace abs_hil::control {

/// The data for the construction of a controller: the options and the rig's nominal parameters. A controller that
/// adapts to theta must not use `rig.tyre.theta_N`. The context is only valid during construction.
struct ControllerContext {
  const ControlOptions& options;
  const rig::RigParameters& rig;
};

}  // namespace abs_hil::control
