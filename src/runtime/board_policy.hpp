#pragma once

#include <string>
#include <vector>

#include "abs_hil/rig/parameters.hpp"
#include "driver/factory.hpp"
#include "driver/injection/injection.hpp"
#include "runtime/gate_options.hpp"
#include "runtime/weak_values.hpp"

namespace abs_hil::runtime {

/// What a run wants of a board: everything that the safety policy judges.
struct BoardUse {
  const driver::DriverOptions& driver;
  bool guarded{true};        ///< guardian.enabled
  bool virtual_time{false};  ///< --fast
  double rate_Hz{0.0};       ///< control cycles per second, > 0
  double guardian_timeout_ms{20.0};
  UnsafeOptions unsafe{};                       ///< risks that a person accepts
  double start_speed_rad_s{0.0};                ///< wheels that turn from the start, a simulator's alone
  std::vector<driver::Injection> injections{};  ///< faults to inject
  std::string controller_file{};                ///< the controller comes from this file; empty: it does not
  std::vector<WeakValue> weak{};                ///< of all options
  int model_counts_per_rev{0};                  ///< encoder counts that the controllers believe; 0: those of the rig
  int rig_counts_per_rev{0};                    ///< encoder counts of the rig's identity
};

/// Largest duties, in [0, 1].
struct DutyCaps {
  double brake{0.0};
  double motor{0.0};
};

/// False for a board that is known to be an emulator: one whose files or interface are not the kernel's, or of which
/// driver.emulated says so. Cards of the kernel and adapters of a real bus are real whatever driver.emulated says.
[[nodiscard]] bool is_real_board(const driver::DriverOptions& driver);

/// Refuses what each key's own range allows and what must not reach a rig: virtual time, wheels that turn from the
/// start, answers that take longer than a period, injected faults, no guardian, a guardian that would end a healthy
/// run, and on hardware every value that weakens the protection without a person's consent. Throws
/// std::invalid_argument, which names the key and the fix. Before anything has moved.
/// @return the weak values that a person has consented to, a sentence each; none for an emulator
std::vector<std::string> refuse_unsafe_use(const BoardUse& use);

/// Refuses caps of the gate above those of the board. Throws std::invalid_argument.
/// @param asked_for  the gate's caps that a person has set; 0 for one that has its default
void refuse_caps_above_board(const DutyCaps& asked_for, const driver::DriverOptions& driver);

/// Lowers the gate's duty caps to the board's, so that the controller's anti-windup knows them, and tells the drivers
/// the encoders' resolution and the rate, which their own checks need. Throws std::invalid_argument for a board without
/// caps.
/// @param rig  the rig's identity
void apply_board_limits(const rig::RigParameters& rig, double rate_Hz, GateOptions& gate,
                        driver::DriverOptions& driver);

}  // namespace abs_hil::runtime
