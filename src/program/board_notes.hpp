#pragma once

#include "abs_hil/driver/rig_driver.hpp"
#include "config/settings.hpp"

namespace abs_hil::program {

/// Logs what the driver reports about its board. Also warns that the driver is not verified on hardware until
/// driver.verified_on_hardware is true. Does nothing for the simulator.
class BoardNotes {
 public:
  BoardNotes(const config::Settings& settings, const driver::RigDriver& driver)
      : settings_(settings), driver_(driver) {}
  /// Logs on the first call, which must come after the driver was configured.
  void log_once();

 private:
  const config::Settings& settings_;
  const driver::RigDriver& driver_;
  bool logged_{false};
};

}  // namespace abs_hil::program
