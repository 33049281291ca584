// What a run may do on hardware: it refuses virtual time, injected faults and weakened limits there.
#include "runtime/board_policy.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

namespace abs_hil::runtime {

namespace {

/// What the options lead to. A kind that no backend has counts as hardware.
driver::BoardReality reality(const driver::DriverOptions& d) {
  if (driver::is_known(d.kind)) return driver::reality_of(d);
  return {.reality = driver::Reality::hardware, .option = "driver.kind = " + d.kind, .is = "is no known board"};
}

bool is_certainly_real(const driver::BoardReality& board) { return board.reality == driver::Reality::hardware; }

void refuse_virtual_time_on_hardware(const BoardUse& use) {
  if (!use.virtual_time || use.driver.emulated) return;
  throw std::invalid_argument(
      "--fast: the rig runs in real time only; leave it out, use --backend sim, or, for an emulator in lock-step "
      "(never for hardware), --set driver.emulated=true");
}

void refuse_start_speed(const BoardUse& use) {
  if (use.start_speed_rad_s <= 0.0) return;
  throw std::invalid_argument(
      "experiment.start_speed_rad_s: a real wheel does not start at speed; leave it out or use --backend sim");
}

void refuse_unfit_options(const BoardUse& use) {
  if (!driver::is_known(use.driver.kind)) return;
  const driver::ChosenBackend board = driver::chosen_backend(use.driver);
  if (!board.entry.check) return;
  driver::RunFacts run = use.driver.facts(use.virtual_time);
  run.rate_Hz = use.rate_Hz;
  run.hardware = is_real_board(use.driver);
  run.outputs_on_after_death = use.unsafe.outputs_on_after_death;
  board.entry.check(board.options, run);
}

void refuse_injection_into_hardware(const BoardUse& use) {
  if (use.injections.empty()) return;
  const driver::DriverOptions& d = use.driver;
  const std::string fault = driver::to_text(use.injections.front());
  if (!d.emulated) {
    throw std::invalid_argument(
        fmt::format("--inject {}: faults are never injected into real hardware; use --backend sim, or for an emulator "
                    "(never hardware) --set driver.emulated=true",
                    fault));
  }
  if (const driver::BoardReality board = reality(d); is_certainly_real(board)) {
    throw std::invalid_argument(
        fmt::format("--inject {}: driver.emulated=true, but {} {}", fault, board.option, board.is));
  }
}

void refuse_hardware_without_guardian(const BoardUse& use) {
  if (use.guarded) return;
  const driver::DriverOptions& d = use.driver;
  if (d.emulated) {
    const driver::BoardReality board = reality(d);
    if (!is_certainly_real(board)) return;
    throw std::invalid_argument(fmt::format(
        "guardian.enabled = false: driver.emulated=true, but {} is real hardware, and real hardware needs a "
        "guardian; leave guardian.enabled out, or name the emulator's",
        board.option));
  }
  throw std::invalid_argument(
      "guardian.enabled = false: a real rig needs a guardian, because its PWMs may hold when the program dies; leave "
      "it "
      "out, or for an emulator (never hardware) --set driver.emulated=true");
}

/// Silence of a single late cycle must not end a run.
void refuse_impatient_guardian(const BoardUse& use) {
  if (!use.guarded || use.virtual_time) return;
  const double two_periods_ms = 2.0 * 1e3 / use.rate_Hz;
  if (use.guardian_timeout_ms >= two_periods_ms) return;
  throw std::invalid_argument(fmt::format(
      "guardian.timeout_ms = {}: the guardian would end a healthy run, whose cycles are {} ms apart; give at "
      "least two periods, {} ms, or a higher control.rate_Hz",
      use.guardian_timeout_ms, two_periods_ms / 2.0, two_periods_ms));
}

/// One rule for all options: what weakens the protection by its row needs a person's consent, and is told.
std::vector<std::string> refuse_weak_values(const BoardUse& use) {
  std::vector<std::string> accepted;
  if (!is_real_board(use.driver)) return accepted;
  for (const WeakValue& weak : use.weak) {
    if (!has_consent(weak, use.unsafe)) {
      const std::string flag = weak.consent.empty() ? "" : fmt::format(" or unsafe.{}=true", weak.consent);
      throw std::invalid_argument(fmt::format(
          "{} = {}: this value weakens the protection of a real board ({}; {}); give another one, or accept "
          "the risk with --set unsafe.keys={}{}",
          weak.key, weak.value, weak.class_text, weak.meaning, weak.key, flag));
    }
    accepted.push_back(fmt::format("{} = {} weakens the protection of this board ({}; {}); unsafe. accepts it",
                                   weak.key, weak.value, weak.class_text, weak.meaning));
  }
  return accepted;
}

/// The gate and the ends of phases would see wrong speeds, on an emulator too.
void refuse_other_counts(const BoardUse& use) {
  if (use.model_counts_per_rev == 0 || use.model_counts_per_rev == use.rig_counts_per_rev) return;
  throw std::invalid_argument(
      fmt::format("model.encoder_counts_per_rev = {0}: the rig's encoders give {1} counts a revolution by its identity "
                  "(rig.encoder_counts_per_rev); leave the model's out, or correct the identity with --set "
                  "rig.encoder_counts_per_rev={0} and commission the board again",
                  use.model_counts_per_rev, use.rig_counts_per_rev));
}

/// A crash of foreign code ends the program. The guardian makes the outputs safe, but a person must want that.
void refuse_foreign_code(const BoardUse& use) {
  if (use.controller_file.empty() || use.unsafe.foreign_controller || !is_real_board(use.driver)) return;
  throw std::invalid_argument(
      fmt::format("--controller {}: code from a file would run in the control cycle of a real board; try it with "
                  "--backend sim first, then accept the risk with --set unsafe.foreign_controller=true",
                  use.controller_file));
}

void refuse_cap_above(std::string_view key, double value, std::string_view board, double board_value) {
  if (value <= board_value) return;
  throw std::invalid_argument(
      fmt::format("gate.{0} = {1}: the board sends at most {2} (driver.{3}.{0}); give a number "
                  "in (0, {2}]",
                  key, value, board_value, board));
}

/// The duty caps of the board that is driven. Throws std::invalid_argument for a board without caps: it is not driven.
DutyCaps caps_of(const driver::DriverOptions& d) {
  if (!driver::is_known(d.kind)) {
    throw std::invalid_argument(
        fmt::format("driver.kind = {}: this board has no duty caps, so it is not driven", d.kind));
  }
  const driver::OutputGrid outputs = driver::output_grid(d);
  return {outputs.brake_duty_max, outputs.motor_duty_max};
}

}  // namespace

bool is_real_board(const driver::DriverOptions& driver) {
  const driver::BoardReality board = reality(driver);
  return board.reality == driver::Reality::unknown ? !driver.emulated : is_certainly_real(board);
}

std::vector<std::string> refuse_unsafe_use(const BoardUse& use) {
  refuse_virtual_time_on_hardware(use);
  refuse_start_speed(use);
  refuse_unfit_options(use);
  refuse_injection_into_hardware(use);
  refuse_hardware_without_guardian(use);
  refuse_impatient_guardian(use);
  refuse_foreign_code(use);
  refuse_other_counts(use);
  return refuse_weak_values(use);
}

void refuse_caps_above_board(const DutyCaps& asked_for, const driver::DriverOptions& driver) {
  const DutyCaps board = caps_of(driver);
  refuse_cap_above("brake_duty_max", asked_for.brake, driver.kind, board.brake);
  refuse_cap_above("motor_duty_max", asked_for.motor, driver.kind, board.motor);
}

void apply_board_limits(const rig::RigParameters& rig, double rate_Hz, GateOptions& gate,
                        driver::DriverOptions& driver) {
  const DutyCaps board = caps_of(driver);
  gate.brake_duty_max = std::min(gate.brake_duty_max, board.brake);
  gate.motor_duty_max = std::min(gate.motor_duty_max, board.motor);
  driver.encoder_counts_per_rev = rig.encoder_counts_per_rev;
  driver.rate_Hz = rate_Hz;
}

}  // namespace abs_hil::runtime
