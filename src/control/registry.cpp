// The table of all controllers, and the making of one by its name.
#include "abs_hil/control/registry.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <ranges>
#include <stdexcept>
#include <vector>

#include "control/adaptive_actuator_controller.hpp"
#include "control/adaptive_controller.hpp"
#include "control/adaptive_optimal_controller.hpp"
#include "control/classic_controllers.hpp"
#include "control/seeking_controllers.hpp"
#include "control/sliding_mode_controllers.hpp"
#include "rig/nearest_name.hpp"

namespace abs_hil::control {
namespace {

template <template <class> class Law>
constexpr ControllerEntry law_entry(std::string_view name, std::string_view summary) noexcept {
  return controller_entry<LawController<Law>>(name, summary);
}

/// A new controller needs a pair of files and one line here (docs/writing-a-controller.md).
constexpr std::array own_table{
    law_entry<AdaptiveLaw>("adaptive", "adaptive slip control, estimates the peak tyre force: (17)-(18) of the paper"),
    law_entry<AdaptiveActuatorLaw>("adaptive-actuator",
                                   "adaptive slip control that steps back through the brake's lag (6)"),
    law_entry<AdaptivePredictorLaw>("adaptive-predictor", "the same with gains that follow from the brake's dead time"),
    law_entry<AdaptivePeakLaw>("adaptive-peak", "seeks the slip of peak friction by itself, told nothing of the tyre"),
    law_entry<AdaptiveOptimalLaw>(
        "adaptive-optimal", "brakes at the unknown peak of friction, and moves the brake as little as that allows"),
    law_entry<NominalLaw>("nominal", "slip control with a known peak tyre force: (16) of the paper"),
    law_entry<SlidingModeLaw>("sliding-mode",
                              "textbook sliding mode, the paper's own baseline is not public: chatters"),
    law_entry<SmoothSlidingModeLaw>("sliding-mode-smooth", "sliding mode with a boundary layer"),
    law_entry<SlidingModeActuatorLaw>("sliding-mode-actuator",
                                      "sliding mode that steps back through the brake's lag (6)"),
    law_entry<SuperTwistingLaw>("super-twisting", "second-order sliding mode with a continuous torque"),
    law_entry<PiLaw>("pi", "speed-scheduled PI with the measured tyre force fed forward"),
    law_entry<MixedSlipDecelerationLaw>("mixed-slip-deceleration",
                                        "PI on a sum of slip and wheel deceleration, estimates nothing"),
    law_entry<BrakingStiffnessLaw>("braking-stiffness",
                                   "raises the slip while the measured tyre force still grows with it"),
    law_entry<RelayLaw>("relay", "brake on below a slip threshold, off above: the rig maker's demonstration"),
    law_entry<FivePhaseLaw>("five-phase", "production-style wheel deceleration thresholds, no slip"),
    law_entry<LockedLaw>("locked", "full brake torque throughout: the reference without ABS"),
};

std::vector<ControllerEntry>& table() noexcept {
  static std::vector<ControllerEntry> entries{own_table.begin(), own_table.end()};
  return entries;
}

std::vector<ControllerFiles>& file_table() noexcept {
  static std::vector<ControllerFiles> entries;
  return entries;
}

std::string unknown_name_message(std::string_view name) {
  if (name.find(':') != std::string_view::npos) {
    return "controller " + std::string(name) +
           ": give a class in Python as MODULE:CLASS, with letters, digits and _ in both names; MODULE may have dots";
  }
  const auto names = table() | std::views::transform(&ControllerEntry::name);
  std::string message = "unknown controller '" + std::string(name) + "'; did you mean '" +
                        std::string(rig::nearest_name(name, names)) + "'? Known controllers:";
  for (const std::string_view known : names) message.append(" ").append(known);
  return message;
}

}  // namespace

OwnOptions::OwnOptions() {
  for (const ControllerEntry& entry : table()) {
    if (entry.own_options == nullptr) continue;
    options_.emplace_back(section_of(entry.name).substr(std::size("control.") - 1), entry.own_options());
  }
}

void OwnOptions::visit_options(const std::string& prefix, const rig::OptionVisitor& visit) {
  for (auto& [section, options] : options_) options.visit_options(prefix + section, visit);
}

bool SlipController::take_over(const SlipController& /*before*/) noexcept { return false; }
bool SlipController::exchange_state(rig::StateBytes& /*state*/) { return false; }

std::string_view controller_name(std::size_t index) noexcept {
  return index < table().size() ? table()[index].name : std::string_view{};
}

std::span<const ControllerEntry> controllers() noexcept { return table(); }

void register_controller(const ControllerEntry& entry) {
  if (entry.name.empty() || entry.make == nullptr)
    throw std::invalid_argument("a controller entry needs a name and a make function");
  if (std::ranges::find(table(), entry.name, &ControllerEntry::name) != table().end()) {
    throw std::invalid_argument("a controller named '" + std::string(entry.name) +
                                "' already exists; choose another name");
  }
  table().push_back(entry);
}

void register_controller_files(const ControllerFiles& files) {
  if (files.make == nullptr || !is_controller_file(std::string("x").append(files.ending))) {
    throw std::invalid_argument("controllers cannot come from files *" + std::string(files.ending));
  }
  if (std::ranges::find(file_table(), files.ending, &ControllerFiles::ending) == file_table().end()) {
    file_table().push_back(files);
  }
}

bool is_controller_file(std::string_view name) noexcept {
  bool fits = false;
  rig::for_each_row<ControlOptions>([&](const auto& row) {
    if constexpr (std::is_same_v<std::remove_cvref_t<decltype(row)>, rig::OptionRow<ControlOptions, std::string>>) {
      if (row.member == &ControlOptions::controller) fits = row.facts.files.fit(name);
    }
  });
  return fits;
}

std::unique_ptr<SlipController> make_controller(std::string_view name, const ControllerContext& context) {
  if (is_controller_file(name)) {
    for (const ControllerFiles& files : file_table()) {
      if (rig::FileEndings{{files.ending}}.fit(name)) return files.make(std::string(name), context);
    }
    throw std::invalid_argument(
        "controller " + std::string(name) +
        ": this program takes no controllers from files and no classes in Python; abs_hil does");
  }
  const auto entry = std::ranges::find(table(), name, &ControllerEntry::name);
  if (entry == table().end()) throw std::invalid_argument(unknown_name_message(name));
  return entry->make(context);
}

std::string section_of(std::string_view controller) {
  std::string name(controller);
  std::ranges::replace(name, '-', '_');
  return "control." + name + '.';
}

bool changes_in_a_run(std::string_view key, const rig::OptionFacts& facts, std::string_view controller) {
  if (key == slip_ref_key) return true;
  if (facts.start_value) return false;
  // The laws (16) and (17) share these two gains.
  if (controller == "nominal" && (key == "control.adaptive.ks0" || key == "control.adaptive.ks1")) return true;
  return key.starts_with(section_of(controller));
}

}  // namespace abs_hil::control
