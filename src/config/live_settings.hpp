#pragma once

#include <string>
#include <string_view>

#include "config/settings.hpp"
#include "experiment/run_logic.hpp"

namespace abs_hil::config {

/// The settings that may change during a run: the slip reference and the gains of the controller. The ranges of the key
/// table apply.
class LiveSettings {
 public:
  explicit LiveSettings(Settings settings) : settings_(std::move(settings)) {}

  /// Returns the full key of a name. The name may lack "control.", and the controller's part too. Throws ConfigError
  /// for a key that is unknown or cannot change during the run.
  [[nodiscard]] std::string resolve(std::string_view name) const;
  /// Returns the adjustment that sets the full key `key` to `value`. Throws ConfigError for a value that is out of
  /// range or that the controller refuses; then nothing changes.
  [[nodiscard]] experiment::Adjustment set(const std::string& key, double value);

  [[nodiscard]] const Settings& settings() const noexcept { return settings_; }

 private:
  Settings settings_;
};

}  // namespace abs_hil::config
