#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "config/settings.hpp"
#include "experiment/adjustment.hpp"

namespace abs_hil::config {

/// The part of a running experiment's configuration that may be changed while it runs: the slip reference and the gains
/// of its controller, within the ranges of the key table.
class LiveSettings {
 public:
  explicit LiveSettings(Settings settings) : settings_(std::move(settings)) {}

  /// The full key for a name that may lack "control." or the controller's part as well. Throws ConfigError for one
  /// that is not known or cannot be changed during the run.
  [[nodiscard]] std::string resolve(std::string_view name) const;
  /// The change that sets `key`, a full one, to `value`. Throws ConfigError for a value out of range or one that the
  /// controller cannot work with; then nothing is changed.
  [[nodiscard]] experiment::Adjustment set(const std::string& key, double value);

  [[nodiscard]] const Settings& settings() const noexcept { return settings_; }

 private:
  Settings settings_;
};

}  // namespace abs_hil::config
