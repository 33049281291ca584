// What a run may do on hardware: the one view of it and the one rule that judges it, which refuses virtual time,
// injected faults and weakened limits there.
#include "config/board_policy.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <stdexcept>
#include <utility>
#include <variant>

#include "abs_hil/control/registry.hpp"
#include "abs_hil/rig/option_check.hpp"
#include "config/injection.hpp"

namespace abs_hil::config {

namespace {

using experiment::EndKind;
using experiment::PhasePlan;
using Verdict = SafetyRow::Verdict;

/// The longest that a phase can last without a fault.
double longest_s(const PhasePlan& phase) {
  double most_s = phase.time_limit_s;
  for (const experiment::EndCondition& end : phase.ends_on) {
    if (end.kind == EndKind::duration) most_s = std::min(most_s, end.value);
  }
  return most_s;
}

/// The highest wheel speed that a condition or its parts wait for; 0: none.
double awaited_rad_s(const experiment::EndCondition& end, double r2_m) {
  double most = 0.0;
  if (end.kind == EndKind::car_speed_above) most = end.value / r2_m;
  if (end.kind == EndKind::upper_speed_above || end.kind == EndKind::lower_speed_above) most = end.value;
  for (const experiment::EndCondition& part : end.parts) most = std::max(most, awaited_rad_s(part, r2_m));
  return most;
}

/// True if a person has consented: by the key in `unsafe.keys`, or by the flag that its row names.
bool is_accepted(const Key& key, const Settings& s, const KeyTable& keys) {
  if (fmt::format(",{},", s.unsafe.keys).find(fmt::format(",{},", key.name)) != std::string::npos) return true;
  const Key* flag = find_key(keys.keys(), fmt::format("unsafe.{}", key.safety.consent));
  return flag != nullptr && value_of(*flag) == Value(true);
}

std::string with_unit(const std::string& value, std::string_view unit) {
  return unit.empty() ? value : fmt::format("{} {}", value, unit);
}

/// What the options lead to. A kind that no backend has counts as hardware.
driver::BoardReality reality(const driver::DriverOptions& d) {
  if (driver::is_known(d.kind)) return driver::reality_of(d);
  return {.reality = driver::Reality::hardware, .option = "driver.kind = " + d.kind, .is = "is no known board"};
}

bool is_certainly_real(const driver::BoardReality& board) { return board.reality == driver::Reality::hardware; }

void refuse_virtual_time_on_hardware(const Settings& s, bool virtual_time) {
  if (!virtual_time || s.driver.emulated) return;
  throw std::invalid_argument(
      "--fast: the rig runs in real time only; leave it out, use --backend sim, or, for an emulator in lock-step "
      "(never for hardware), --set driver.emulated=true");
}

void refuse_start_speed(const Settings& s) {
  if (s.experiment.start_speed_rad_s <= 0.0) return;
  throw std::invalid_argument(
      "experiment.start_speed_rad_s: a real wheel does not start at speed; leave it out or use --backend sim");
}

void refuse_unfit_options(const Settings& s, bool virtual_time) {
  if (!driver::is_known(s.driver.kind)) return;
  const driver::ChosenBackend board = driver::chosen_backend(s.driver);
  if (!board.entry.check) return;
  driver::RunFacts run = s.driver.facts(virtual_time);
  run.rate_Hz = s.control.rate_Hz;
  run.hardware = is_real_board(s.driver);
  run.outputs_on_after_death = s.unsafe.outputs_on_after_death;
  board.entry.check(board.options, run);
}

void refuse_injection_into_hardware(const Settings& s) {
  const std::vector<Injection> injections = parse_injections(s.inject);
  if (injections.empty()) return;
  const driver::DriverOptions& d = s.driver;
  const std::string fault = to_text(injections.front());
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

void refuse_hardware_without_guardian(const Settings& s) {
  const driver::BoardReality board = reality(s.driver);
  if (s.guardian.enabled || (s.driver.emulated && !is_certainly_real(board))) return;
  throw std::invalid_argument(fmt::format(
      "guardian.enabled = false: a real rig needs a guardian, because its PWMs may hold when the program dies{}; "
      "leave it out, or for an emulator (never hardware) --set driver.emulated=true",
      s.driver.emulated ? fmt::format(", and {} is real hardware", board.option) : ""));
}

/// Silence of a single late cycle must not end a run.
void refuse_impatient_guardian(const Settings& s, bool virtual_time) {
  if (!s.guardian.enabled || virtual_time) return;
  const double two_periods_ms = 2.0 * 1e3 / s.control.rate_Hz;
  if (s.guardian.timeout_ms >= two_periods_ms) return;
  throw std::invalid_argument(fmt::format(
      "guardian.timeout_ms = {}: the guardian would end a healthy run, whose cycles are {} ms apart; give at "
      "least two periods, {} ms, or a higher control.rate_Hz",
      s.guardian.timeout_ms, two_periods_ms / 2.0, two_periods_ms));
}

/// The gate and the ends of phases would see wrong speeds, on an emulator too.
void refuse_other_counts(const Settings& s) {
  const std::int32_t model = s.model.encoder_counts_per_rev;
  const std::int32_t rig = s.rig.parameters.encoder_counts_per_rev;
  if (model == rig) return;
  throw std::invalid_argument(
      fmt::format("model.encoder_counts_per_rev = {0}: the rig's encoders give {1} counts a revolution by its identity "
                  "(rig.encoder_counts_per_rev); leave the model's out, or correct the identity with --set "
                  "rig.encoder_counts_per_rev={0} and commission the board again",
                  model, rig));
}

/// A crash of foreign code ends the program. The guardian makes the outputs safe, but a person must want that.
void refuse_foreign_code(const Settings& s) {
  const std::string& controller = s.control.controller;
  if (!control::is_controller_file(controller) || s.unsafe.foreign_controller || !is_real_board(s.driver)) return;
  throw std::invalid_argument(
      fmt::format("--controller {}: code from a file would run in the control cycle of a real board; try it with "
                  "--backend sim first, then accept the risk with --set unsafe.foreign_controller=true",
                  controller));
}

/// Lowers a duty cap of the gate to the board's. Refuses a higher one that a person has set.
void lower_cap(double& cap, std::string_view key, double board_cap, std::string_view board, const KeyTable& keys) {
  if (cap > board_cap && keys.was_set(fmt::format("gate.{}", key))) {
    throw std::invalid_argument(
        fmt::format("gate.{0} = {1}: the board sends at most {2} (driver.{3}.{0}); give a number in (0, {2}]", key, cap,
                    board_cap, board));
  }
  cap = std::min(cap, board_cap);
}

}  // namespace

SafetyView safety_view(const Settings& s, const KeyTable& keys, const Plan& plan) {
  SafetyView view;
  const auto add = [&](const std::string& what, const std::string& value, const Key& key, bool weak) {
    const std::string_view flag = key.safety.consent;
    view.push_back({.what = what,
                    .value = with_unit(value, key.unit),
                    .bound = fmt::format("{}; {}", key.safety.in_words(key.unit), key.meaning),
                    .fix = fmt::format("--set unsafe.keys={}{}", key.name,
                                       flag.empty() ? "" : fmt::format(" or unsafe.{}=true", flag)),
                    .verdict = !weak                       ? Verdict::holds
                               : is_accepted(key, s, keys) ? Verdict::accepted
                                                           : Verdict::weak});
  };
  using Kind = rig::SafetyClass::Kind;
  for (const Key& key : keys.keys()) {
    const Kind kind = safety_of(key).kind;
    if (kind < Kind::above || kind > Kind::text) continue;  // no value weakens, or another rule judges
    add(key.name, text_of(value_of(key)), key,
        std::visit([&key](const auto* target) { return rig::weakens(key, *target); }, key.target));
  }
  // The keys' ranges let a car in. Limits from such an identity would protect no rig of a laboratory.
  for (const auto& [name, most] : {std::pair("rig.theta_N", 500.0), std::pair("rig.b1_Nm", 1000.0)}) {
    Key key = *find_key(keys.keys(), name);
    key.safety = rig::weaker_above(most);
    add(key.name, text_of(value_of(key)), key, rig::weakens(key, number_of(value_of(key)).value_or(0.0)));
  }
  const auto tell = [&view](const std::string& what, double value, std::string_view unit) {
    view.push_back({.what = what, .value = with_unit(fmt::format("{:.6g}", value), unit)});
  };
  // A number of the plan, by the row of the key that bounds it.
  const auto judge = [&](const std::string& what, double value, std::string_view name) {
    const Key& key = *find_key(keys.keys(), name);
    add(what, fmt::format("{:.6g}", value), key, rig::weakens(key, value));
  };
  // Phases that follow one another with the drive on are one drive, however a script divides it.
  double drive_s = 0.0, whole_s = 0.0;
  for (const PhasePlan& phase : plan.phases) {
    const std::string name = fmt::format("phase \"{}\": ", phase.name);
    const bool drives = !phase.motor_duty.zero();
    drive_s = drives ? drive_s + longest_s(phase) : 0.0;
    if (drives) {
      whole_s += longest_s(phase);
      tell(name + "drive duty at most", std::min(highest(phase.motor_duty), s.gate.motor_duty_max), "");
      judge(name + "drive on in a row for at most", drive_s, "experiment.accelerate_limit_s");
      const double awaited = awaited_rad_s({.parts = phase.ends_on}, s.rig.parameters.wheels.r2_m);
      if (awaited > 0.0) judge(name + "drives until a wheel turns at", awaited, "experiment.cut_speed_rad_s");
    }
    if (phase.brake == experiment::BrakeAction::released) continue;
    judge(name + "brake on for at most", longest_s(phase),
          phase.phase == rig::Phase::hold ? "experiment.hold_limit_s" : "experiment.brake_limit_s");
  }
  tell("drive on in the whole run for at most", whole_s, "s");
  return view;
}

std::vector<std::string> refuse_weak_rows(const SafetyView& view) {
  std::vector<std::string> accepted;
  for (const SafetyRow& row : view) {
    if (row.verdict == Verdict::weak)
      throw std::invalid_argument(
          fmt::format("{} = {}: this value weakens the protection of a real board ({}); give another one, or accept "
                      "the risk with {}",
                      row.what, row.value, row.bound, row.fix));
    if (row.verdict != Verdict::accepted) continue;
    accepted.push_back(fmt::format("{} = {} weakens the protection of this board ({}); unsafe. accepts it", row.what,
                                   row.value, row.bound));
  }
  return accepted;
}

std::string in_words(const SafetyView& view) {
  static constexpr std::array words{"", "  ok", "  WEAK", "  weak, accepted"};
  std::string text;
  for (const SafetyRow& row : view) {
    text += fmt::format("{} = {}{}{}\n", row.what, row.value.empty() ? "(empty)" : row.value,
                        words.at(static_cast<std::size_t>(row.verdict)),
                        row.bound.empty() ? "" : fmt::format(" ({})", row.bound));
  }
  return text;
}

bool is_real_board(const driver::DriverOptions& driver) {
  const driver::BoardReality board = reality(driver);
  return board.reality == driver::Reality::unknown ? !driver.emulated : is_certainly_real(board);
}

std::vector<std::string> refuse_unsafe_use(const Settings& s, const SafetyView& view, bool virtual_time) {
  refuse_virtual_time_on_hardware(s, virtual_time);
  refuse_start_speed(s);
  refuse_unfit_options(s, virtual_time);
  refuse_injection_into_hardware(s);
  refuse_hardware_without_guardian(s);
  refuse_impatient_guardian(s, virtual_time);
  refuse_foreign_code(s);
  refuse_other_counts(s);
  return is_real_board(s.driver) ? refuse_weak_rows(view) : std::vector<std::string>{};
}

void apply_board_limits(Settings& s, const KeyTable& keys) {
  const std::string& kind = s.driver.kind;
  if (!driver::is_known(kind)) {
    throw std::invalid_argument(
        fmt::format("driver.kind = {}: this board has no duty caps, so it is not driven", kind));
  }
  const driver::OutputGrid board = driver::output_grid(s.driver);
  lower_cap(s.gate.brake_duty_max, "brake_duty_max", board.brake_duty_max, kind, keys);
  lower_cap(s.gate.motor_duty_max, "motor_duty_max", board.motor_duty_max, kind, keys);
  s.driver.encoder_counts_per_rev = s.rig.parameters.encoder_counts_per_rev;
  s.driver.rate_Hz = s.control.rate_Hz;
}

}  // namespace abs_hil::config
