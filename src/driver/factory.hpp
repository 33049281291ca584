#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abs_hil/driver/backend.hpp"
#include "abs_hil/rig/option.hpp"
#include "driver/board_options.hpp"

namespace abs_hil::driver {

/// Name number `index` of the registered backends; empty beyond the last.
[[nodiscard]] std::string_view board_name(std::size_t index) noexcept;

/// The options of all registered backends, each below its name.
class AllBoardOptions {
 public:
  AllBoardOptions();
  [[nodiscard]] const BoardOptions* find(std::string_view kind) const noexcept;
  void visit_options(const std::string& prefix, const rig::OptionVisitor& visit);
  /// The options of the backend that has options of this type. Throws std::logic_error if there is none.
  template <class Options>
  [[nodiscard]] Options& of() {
    for (auto& [name, options] : boards_) {
      if (Options* found = options.template as<Options>()) return *found;
    }
    throw std::logic_error("no registered backend has options of this type");
  }

 private:
  std::vector<std::pair<std::string_view, BoardOptions>> boards_{};
};

/// Everything below `driver.` in the configuration.
struct DriverOptions {
  ABS_HIL_OPTIONS(DriverOptions);
  ABS_HIL_OPTION(std::string, kind, "pci", .meaning = "board behind --backend rig", .allowed = board_name,
                 .safety = rig::commissioned);
  /// Refused where there is no emulator.
  ABS_HIL_OPTION(bool, emulated, false, .meaning = "the board is an emulator: --fast may drive its time in lock-step",
                 .safety = rig::judged_elsewhere);
  /// Until then doctor and log say otherwise.
  ABS_HIL_OPTION(bool, verified_on_hardware, false,
                 .meaning = "this lab has gone through docs/rig-setup.md on its own rig",
                 .safety = rig::no_effect_on_safety);
  ABS_HIL_OPTION(std::string, records, "",
                 .meaning = "folder of the commissioning records; empty: /var/lib/abs_hil/boards, or the user's own",
                 .safety = rig::weaker_unless(""));
  ABS_HIL_GROUP(AllBoardOptions, boards, "", {});
  ABS_HIL_GROUP(SimOptions, sim, "sim.", {});
  // Known from elsewhere in the configuration.
  double rate_Hz{1000.0};  ///< cycles per second
  std::int32_t encoder_counts_per_rev{4096};

  [[nodiscard]] RunFacts facts(bool lock_step = false) const noexcept {
    return {.lock_step = lock_step,
            .emulated = emulated,
            .rate_Hz = rate_Hz,
            .encoder_counts_per_rev = encoder_counts_per_rev};
  }
};

/// A value of `--backend`.
struct BackendKind {
  std::string_view name;
  std::string_view summary;
};
/// Values of `--backend`. Callers make a SimDriver themselves for the simulated one: only driver/sim knows the plant.
[[nodiscard]] std::span<const BackendKind> backend_kinds() noexcept;

/// True if there is a backend with this name.
[[nodiscard]] bool is_known(std::string_view kind);

/// The backend that driver.kind names, and its options. Throws Unavailable for a kind that no backend has.
struct ChosenBackend {
  const Backend& entry;
  const BoardOptions& options;
};
[[nodiscard]] ChosenBackend chosen_backend(const DriverOptions& options);

/// Makes the driver of the board that `options.kind` names; its `configure` looks for the board. Throws
/// std::invalid_argument for an option outside its range, Unavailable for a kind that no backend has.
/// @param lock_step  the driver advances an emulator's time (`options.emulated`, `--fast`)
[[nodiscard]] std::unique_ptr<RigDriver> make_rig_driver(const DriverOptions& options, bool lock_step = false);

/// What the outputs make of a command: those of the board that `options.kind` names, or of the simulated rig with
/// `any_brake_duty` for its ideal actuator. Throws Unavailable for a kind that no backend has.
[[nodiscard]] OutputGrid output_grid(const DriverOptions& options);
[[nodiscard]] OutputGrid simulated_output_grid(const DriverOptions& options, bool any_brake_duty);

/// Makes the writer of the safe state for the board that `options.kind` names. Throws Unavailable for a kind that no
/// backend has.
/// @param beside_guardian  it works although a guardian keeps the board
[[nodiscard]] std::unique_ptr<SafeStateWriter> make_safe_state_writer(const DriverOptions& options,
                                                                      bool beside_guardian = false);

/// What the options of the chosen board lead to. Throws Unavailable for a kind that no backend has.
[[nodiscard]] BoardReality reality_of(const DriverOptions& options);

/// The warning "not verified on hardware ..."; empty if `verified_on_hardware` is set.
[[nodiscard]] std::string verification_note(const DriverOptions& options);

}  // namespace abs_hil::driver
