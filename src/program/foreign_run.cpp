// What a run with a controller from a file does beside: its trial, its place, its part of the summary.
#include "program/foreign_run.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "run_folder/run_folder.hpp"

namespace abs_hil::program {

namespace {

constexpr double us_per_ns = 1e-3;

double us(std::int64_t duration_ns) { return static_cast<double>(duration_ns) * us_per_ns; }

}  // namespace

ForeignRun::ForeignRun(bool on_rig) : on_rig_(on_rig) {
  interchange::set_home(on_rig ? interchange::Home::this_process : interchange::Home::own_process);
}

void ForeignRun::look_at(control::SlipController& controller, bool try_out) {
  controller_ = dynamic_cast<interchange::ForeignController*>(&controller);
  if (controller_ == nullptr) return;
  sha256_ = run_folder::sha256_of_file(controller_->source());
  if (!try_out) return;
  trial_ = controller_->try_out();
  const interchange::Offences& found = trial_->offences;
  if (found.allocations > 0) {
    spdlog::warn("controller {}: {} allocations in {} trial steps: an allocation can wait for a lock",
                 controller_->file(), found.allocations, trial_->times.steps);
  }
  if (found.system_calls > 0) {
    spdlog::warn("controller {}: {} system calls in {} trial steps, the first one number {}: the kernel can delay them",
                 controller_->file(), found.system_calls, trial_->times.steps, found.first_system_call);
  }
  if (trial_->died_without_system) {
    spdlog::warn(
        "controller {}: it died in a trial in which its system calls failed: it needs them, and the kernel can "
        "delay them",
        controller_->file());
  }
  spdlog::info("controller {}: steps took {:.1f} us at most in a trial of {}", controller_->file(),
               us(trial_->times.worst_ns), trial_->times.steps);
}

nlohmann::ordered_json ForeignRun::summary() const {
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
  if (const std::string why = failure(); !why.empty()) json["failure"] = why;
  return json;
}

}  // namespace abs_hil::program
