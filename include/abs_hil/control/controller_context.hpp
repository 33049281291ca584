#pragma once

#include "abs_hil/control/options.hpp"
#include "abs_hil/rig/parameters.hpp"

namespace abs_hil::control {

/// What every controller may know when it is made: the options and the rig's nominal parameters. A controller that
/// adapts to theta does not look at `rig.tyre.theta_N`. Only read while a controller is constructed.
struct ControllerContext {
  const ControlOptions& options;
  const rig::RigParameters& rig;
};

}  // namespace abs_hil::control
