#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "interchange/foreign_controller.hpp"

namespace abs_hil::program {

/// A run's controller that comes from a file, if it does: where it runs, its trial, its part of the summary.
class ForeignRun {
 public:
  /// Decides where the code will run. Call it before the controller is made.
  explicit ForeignRun(bool on_rig);

  /// Takes note of the controller and, with `try_out`, tries it out for a run in real time. Logs what real-time code
  /// must not do.
  /// Throws std::invalid_argument if it cannot run at this rate. The controller must outlive this object.
  void look_at(control::SlipController& controller, bool try_out);
  /// For the summary; null if the controller does not come from a file.
  [[nodiscard]] nlohmann::ordered_json summary() const;
  /// Why its code gave no outputs any more; empty if it did to the end.
  [[nodiscard]] std::string failure() const { return controller_ == nullptr ? "" : controller_->failure(); }

 private:
  bool on_rig_;
  interchange::ForeignController* controller_{nullptr};
  std::string sha256_{};
  std::optional<interchange::ForeignTrial> trial_{};
};

}  // namespace abs_hil::program
