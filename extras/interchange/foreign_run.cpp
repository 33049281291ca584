// The extra "interchange" in the program: slip controllers from files.
#include <spdlog/spdlog.h>

#include <memory>
#include <optional>
#include <string>

#include "interchange/foreign_controller.hpp"
#include "program/extra.hpp"
#include "run_folder/run_folder.hpp"

namespace abs_hil::interchange {

namespace {

/// A run's controller that comes from a file, if it does: where it runs, its trial, its part of the summary.
class ForeignRun final : public program::RunPart {
 public:
  /// Decides where the code will run, before the controller is made.
  explicit ForeignRun(const config::Settings& s) : on_rig_(s.on_rig()) {
    set_home(on_rig_ ? Home::this_process : Home::own_process, s.unsafe.foreign_files);
  }

  /// Takes note of the controller. Tries it out for a run in real time, and logs what real-time code must not do.
  /// Throws std::invalid_argument if it cannot run at this rate.
  void attach(run::Run& run) override {
    controller_ = dynamic_cast<ForeignController*>(&run.controller());
    if (controller_ == nullptr) return;
    sha256_ = run_folder::sha256_of_file(controller_->source());
    if (run.real_time()) log_trial(trial_.emplace(controller_->try_out()));
  }

  [[nodiscard]] nlohmann::ordered_json controller_facts() const override {
    if (controller_ == nullptr) return nullptr;
    const rig::DurationQuantiles steps = controller_->step_times().summary();
    nlohmann::ordered_json json{{"file", controller_->file()},
                                {"sha256", sha256_},
                                {"own_process", !on_rig_},
                                {"steps", controller_->step_times().count()},
                                {"step_us",
                                 {{"p50", steps.p50_us},
                                  {"p99", steps.p99_us},
                                  {"p99_9", steps.p99_9_us},
                                  {"max", us(controller_->step_times().max_ns())}}}};
    if (trial_) {
      json["trial"] = {{"steps", trial_->times.steps},
                       {"step_us",
                        {{"p50", us(trial_->times.median_ns)},
                         {"p99", us(trial_->times.p99_ns)},
                         {"max", us(trial_->times.worst_ns)}}},
                       {"allocations", trial_->offences.allocations},
                       {"system_calls", trial_->offences.system_calls},
                       {"died_without_system_calls", trial_->died_without_system}};
    }
    if (const std::string why = controller_->failure(); !why.empty()) json["failure"] = why;
    return json;
  }

 private:
  static double us(std::int64_t duration_ns) { return 1e-3 * static_cast<double>(duration_ns); }

  void log_trial(const ForeignTrial& trial) const {
    const Offences& found = trial.offences;
    if (found.allocations > 0) {
      spdlog::warn("controller {}: {} allocations in {} trial steps: an allocation can wait for a lock",
                   controller_->file(), found.allocations, trial.times.steps);
    }
    if (found.system_calls > 0) {
      spdlog::warn(
          "controller {}: {} system calls in {} trial steps, the first one number {}: the kernel can delay them",
          controller_->file(), found.system_calls, trial.times.steps, found.first_system_call);
    }
    if (trial.died_without_system) {
      spdlog::warn(
          "controller {}: it died in a trial in which its system calls failed: it needs them, and the kernel can "
          "delay them",
          controller_->file());
    }
    spdlog::info("controller {}: steps took {:.1f} us at most in a trial of {}", controller_->file(),
                 us(trial.times.worst_ns), trial.times.steps);
  }

  bool on_rig_;
  ForeignController* controller_{nullptr};
  std::string sha256_{};
  std::optional<ForeignTrial> trial_{};
};

}  // namespace

}  // namespace abs_hil::interchange

namespace abs_hil::program {

extern const Extra interchange_extra;
constinit const Extra interchange_extra{.name = "interchange",
                                        .begin = &interchange::register_foreign_controllers,
                                        .join = [](const RunRequest& request) -> std::unique_ptr<RunPart> {
                                          return std::make_unique<interchange::ForeignRun>(request.settings);
                                        }};

}  // namespace abs_hil::program
