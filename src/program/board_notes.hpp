#pragma once

#include "abs_hil/driver/rig_driver.hpp"
#include "config/settings.hpp"

namespace abs_hil::program {

/// Says in the log what the driver found out about its board, and that nobody has tried it on hardware until the
/// configuration says that somebody has. Nothing for the simulator.
class BoardNotes {
 public:
  BoardNotes(const config::Settings& settings, const driver::RigDriver& driver)
      : settings_(settings), driver_(driver) {}
  /// Does so on the first call, which must come when the driver is configured.
  void log_once();

 private:
  const config::Settings& settings_;
  const driver::RigDriver& driver_;
  bool logged_{false};
};

}  // namespace abs_hil::program
