#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abs_hil/driver/rig_driver.hpp"
#include "abs_hil/driver/safe_state_writer.hpp"
#include "abs_hil/rig/command.hpp"
#include "abs_hil/rig/duty_grid.hpp"
#include "abs_hil/rig/option.hpp"
#include "abs_hil/rig/option_box.hpp"

// A board behind `--backend rig` is one entry: its name, its option rows, its driver, its safe-state writer, how well
// it is known. The program, the guardian, the doctor and the commissioning all use this entry
// (docs/writing-a-backend.md).

namespace abs_hil::driver {

/// What a board's outputs make of a command: the resolution of their duties, and the driver's own caps.
struct OutputGrid {
  std::uint32_t duty_steps{0};  ///< > 0; steps from duty 0 to duty 1
  double motor_duty_max{1.0};
  double brake_duty_max{1.0};
  bool any_brake_duty{false};  ///< the brake is not rounded (`plant.ideal_actuator`)

  [[nodiscard]] std::uint32_t motor_width(const rig::Command& command) const noexcept {
    return command.motor_enable ? rig::width_for(duty_steps, command.motor_duty, motor_duty_max) : 0;
  }
  [[nodiscard]] std::uint32_t brake_width(const rig::Command& command) const noexcept {
    return rig::width_for(duty_steps, command.brake_duty, brake_duty_max);
  }
  /// The command as it goes out. Its duties are in [0, 1]. Real-time safe.
  [[nodiscard]] rig::Command as_sent(const rig::Command& command) const noexcept {
    rig::Command sent = command;
    sent.motor_duty = rig::duty_of(motor_width(command), duty_steps);
    if (!any_brake_duty) sent.brake_duty = rig::duty_of(brake_width(command), duty_steps);
    return sent;
  }
};

/// What a board learns of the run besides its own options.
struct RunFacts {
  bool lock_step{false};  ///< the driver advances an emulator's time (`--fast`)
  bool emulated{false};   ///< driver.emulated
  double rate_Hz{1000.0};
  std::int32_t encoder_counts_per_rev{4096};
  bool hardware{false};                ///< for `check`: the board counts as hardware
  bool outputs_on_after_death{false};  ///< for `check`: unsafe.outputs_on_after_death
  bool beside_guardian{false};         ///< for the safe-state writer: it works although a guardian has the board
};

/// What the options of a board lead to. `unknown`: the options do not tell, so driver.emulated decides.
enum class Reality : std::uint8_t { unknown, hardware, emulator };
struct BoardReality {
  Reality reality{Reality::unknown};
  std::string option{};  ///< of hardware: the option that tells, "driver.pci.root = /sys/bus/pci/devices"
  std::string is{};      ///< of hardware: what it is, and the fix: "holds the real cards; give the emulator's folder"
};

/// A board that a backend finds on this computer, without access to its registers.
struct FoundBoard {
  /// What keeps a run from using the board, and the commands that mend it, one per line.
  struct Obstacle {
    std::string what{};
    std::string fix{};
  };
  std::string what{};                    ///< "RT-DAC4/PCI at 0000:03:00.0"
  std::string detail{};                  ///< observations, as text
  std::vector<std::string> selection{};  ///< assignments that select it: "driver.pci.bdf=0000:03:00.0"
  std::vector<std::string> files{};      ///< files that the process which drives the board has open
  std::vector<Obstacle> obstacles{};
};

/// One item of this computer, as `abs_hil doctor` found it.
struct Finding {
  /// A note needs no action, a warning costs quality, and after a failure the backend cannot run.
  enum class Standing : std::uint8_t { good, note, warning, failure };

  std::string check{};  ///< name of its check, as in `abs_hil doctor --only CHECK`; of a backend's `inspect` its name
  std::string what{};   ///< the item, as "SCHED_FIFO priority 80"
  Standing standing{Standing::good};
  std::string detail{};  ///< the observation
  std::string fix{};     ///< commands or advice, one per line; empty if no action is needed
};

/// The options of one backend.
using BoardOptions = rig::OptionBox;

/// One entry of the registry, for code that does not know the type of the options. Make it from a `BackendRow`.
struct Backend {
  std::string_view name;     ///< value of driver.kind; its options are driver.NAME.*
  std::string_view summary;  ///< for `abs_hil list`
  std::string_view not_verified;
  BoardOptions defaults;
  std::function<std::unique_ptr<RigDriver>(const BoardOptions&, const RunFacts&)> make_driver;
  std::function<std::unique_ptr<SafeStateWriter>(const BoardOptions&, const RunFacts&)> make_safe_state_writer;
  std::function<OutputGrid(const BoardOptions&)> outputs;
  std::function<BoardReality(const BoardOptions&)> reality{};
  std::function<std::vector<FoundBoard>(const BoardOptions&)> find{};
  std::function<std::vector<Finding>(const BoardOptions&, double rate_Hz, bool chosen)> inspect{};
  std::function<void(const BoardOptions&, const RunFacts&)> check{};
  std::function<std::string(const BoardOptions&)> udp_peer{};
  std::vector<std::string_view> free_options{};
};

/// The same as its author writes it. `Options` is a struct of ABS_HIL_OPTION rows (rig/option.hpp).
template <class Options>
struct BackendRow {
  std::string_view name;
  std::string_view summary;
  /// What has not been tried on hardware, and the page that says how to try it. The program repeats it until
  /// driver.verified_on_hardware is true.
  std::string_view not_verified;
  /// Makes the driver; its `configure` looks for the board. Throws std::invalid_argument for an invalid option.
  std::unique_ptr<RigDriver> (*make_driver)(const Options&, const RunFacts&);
  /// Makes the writer with which a second process brings the board into the safe state.
  std::unique_ptr<SafeStateWriter> (*make_safe_state_writer)(const Options&, const RunFacts&);
  OutputGrid (*outputs)(const Options&);
  /// Null: the options do not tell.
  BoardReality (*reality)(const Options&) = nullptr;
  /// Finds the boards that the options do not exclude. Null: it cannot look for boards; then there is one, which the
  /// options name.
  std::vector<FoundBoard> (*find)(const Options&) = nullptr;
  /// Looks at what leads to the board, for `abs_hil doctor`; `chosen`: driver.kind names it. Writes to no board, and
  /// sends only to a chosen one. Null: the doctor says no more than `find` does.
  std::vector<Finding> (*inspect)(const Options&, double rate_Hz, bool chosen) = nullptr;
  /// Checks options against the run. Throws std::invalid_argument. Null: nothing to check.
  void (*check)(const Options&, const RunFacts&) = nullptr;
  /// Of a board that is reached by UDP: its address and port as /proc/net/udp has them, to find foreign writers.
  std::string (*udp_peer)(const Options&) = nullptr;
  /// Names of options that say where the board is, or how patient the driver is. A commissioning of the board holds for
  /// any value of these, and only for the values of all others that it had. Caps may also be lower.
  std::vector<std::string_view> free_options = {};
};

/// Makes the registry's entry. Throws std::invalid_argument if the row lacks a name, a driver, a safe-state writer or
/// outputs: nothing drives a board that cannot be made safe.
template <class Options>
[[nodiscard]] Backend backend(const BackendRow<Options>& row, Options defaults = {});

/// Adds a backend from outside this library. Throws std::invalid_argument if its name already exists. Call it before
/// any other use of this library: it is not thread-safe.
void register_backend(const Backend& entry);

/// All backends, in the order of `abs_hil list`: those of this library, then the registered ones. The span is valid
/// until the next registration.
[[nodiscard]] std::span<const Backend> registered_backends();

/// Throws std::invalid_argument for a row without a needed part.
void require_complete(std::string_view name, bool makes_driver, bool makes_writer, bool has_outputs);

template <class Options>
Backend backend(const BackendRow<Options>& row, Options defaults) {
  require_complete(row.name, row.make_driver != nullptr, row.make_safe_state_writer != nullptr, row.outputs != nullptr);
  // The registry passes the options on that it has from this very entry.
  const auto with = [](auto function) {
    return [function](const BoardOptions& options, const auto&... facts) {
      return function(*options.as<Options>(), facts...);
    };
  };
  Backend entry{.name = row.name,
                .summary = row.summary,
                .not_verified = row.not_verified,
                .defaults = BoardOptions::of(std::move(defaults)),
                .make_driver = with(row.make_driver),
                .make_safe_state_writer = with(row.make_safe_state_writer),
                .outputs = with(row.outputs)};
  if (row.reality != nullptr) entry.reality = with(row.reality);
  if (row.find != nullptr) entry.find = with(row.find);
  if (row.inspect != nullptr) entry.inspect = with(row.inspect);
  if (row.check != nullptr) entry.check = with(row.check);
  if (row.udp_peer != nullptr) entry.udp_peer = with(row.udp_peer);
  entry.free_options = row.free_options;
  return entry;
}

}  // namespace abs_hil::driver
