// The steps of a commissioning, in their order, and what each must see before the next.
#include "experiment/commissioning.hpp"

#include <cmath>
#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <utility>

#include "abs_hil/rig/time_units.hpp"
#include "rig/encoder_scale.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::experiment {

namespace {

using rig::formatted;

/// Turning by hand gives more than this part of a turn, trembling gives less.
constexpr double least_turn = 0.125;
/// A person sets a mark on the rim to a pointer within a few degrees: 3 % are 11. An encoder of another number of
/// lines, or one that is read by half its edges, is further off. Without this check distances, speeds and torques of a
/// run would be wrong by that factor, and nothing in a run can tell: both wheels look slower or faster, as on another
/// rig.
constexpr double turn_tolerance = 0.03;
/// A wheel counts as standing if it moves less than `still_counts` in this time.
constexpr std::int64_t standstill_ns = 500'000'000;
/// Between two readings while a wheel is turned by hand: counters of 16 bits must not pass their half meanwhile.
constexpr std::int64_t watch_ns = 50 * rig::ns_per_ms;

void require(bool in_range, const char* what, double value, const char* range) {
  if (!in_range) throw std::invalid_argument(formatted("%s = %g: give a number in %s", what, value, range));
}

std::string in_words(const OutputTimes& times) {
  if (!times.reported) return "this board does not report its outputs: its watchdog and its release were not measured";
  const std::string watchdog =
      times.watchdog_ms
          ? formatted("without commands the board ends its outputs by itself after %.1f ms", *times.watchdog_ms)
          : formatted("without commands the board HOLDS its outputs, for %.0f ms at least: it has no watchdog",
                      times.watched_ms);
  return watchdog + formatted("; the safe state was verified %.3f ms after its order", times.release_ms.value_or(0.0));
}

}  // namespace

WheelCounts travel_between(const rig::Measurement& before, const rig::Measurement& after) noexcept {
  return {.upper = rig::counts_between(before.upper_counts, after.upper_counts),
          .lower = rig::counts_between(before.lower_counts, after.lower_counts)};
}

std::string reason_and_error(const driver::IoResult& result) {
  const std::string error = driver::error_text(result);
  return result.reason == rig::Reason::none ? error : std::string(rig::description(result.reason)) + ": " + error;
}

Commissioning::Commissioning(driver::RigDriver& driver, runtime::Clock& clock, Dialog& dialog, PulseGuard& guard,
                             const CommissioningOptions& options, std::function<bool()> stop_requested)
    : driver_(driver),
      clock_(clock),
      dialog_(dialog),
      guard_(guard),
      options_(options),
      stop_requested_(std::move(stop_requested)) {
  require(options.drive_duty > 0.0 && options.drive_duty <= 0.3, "drive duty", options.drive_duty, "(0, 0.3]");
  require(options.brake_duty > 0.0 && options.brake_duty <= 0.7, "brake duty", options.brake_duty, "(0, 0.7]");
  require(options.encoder_counts_per_rev > 0, "encoder counts per turn", options.encoder_counts_per_rev, "(0, inf)");
}

CommissioningResult Commissioning::run() {
  // Makes the rig safe, however a step ends.
  const std::shared_ptr<void> at_end(nullptr, [this](void*) { static_cast<void>(driver_.deactivate()); });
  for (const auto step : {&Commissioning::read_board, &Commissioning::turn_by_hand, &Commissioning::drive_pulse,
                          &Commissioning::pull_cable, &Commissioning::brake_pulse}) {
    const CommissioningResult result = (this->*step)();
    if (result != CommissioningResult::passed) return stop_requested_() ? CommissioningResult::interrupted : result;
  }
  const driver::IoResult result = driver_.deactivate();
  if (!result.ok()) {
    dialog_.tell("the safe state may not have reached the board: " + reason_and_error(result));
    return CommissioningResult::failed;
  }
  return CommissioningResult::passed;
}

bool Commissioning::read(rig::Measurement& measurement) {
  const driver::IoResult result = driver_.read(clock_.now_ns(), measurement);
  if (!result.ok()) {
    dialog_.tell("FAILED: cannot read the board: " + reason_and_error(result));
  } else if (measurement.trip_flags != 0) {
    dialog_.tell(formatted("FAILED: the board's interlocks have tripped, flags 0x%x (bit 0x2: supply voltage)",
                           measurement.trip_flags));
  }
  return result.ok() && measurement.trip_flags == 0;
}

bool Commissioning::read_fresh(rig::Measurement& measurement) {
  constexpr int tries = 20;
  const std::int64_t from_ns = clock_.now_ns();
  for (int attempt = 0; attempt < tries; ++attempt) {
    if (!read(measurement)) return false;
    if (measurement.time_ns >= from_ns) return true;
    clock_.sleep_until(clock_.now_ns() + cycle_ns);
  }
  dialog_.tell(formatted("FAILED: the board did not answer %d times in a row: check its cable and its link", tries));
  return false;
}

CommissioningResult Commissioning::read_board() {
  if (!agrees(step(1) + "the program opens the board and reads its registers. It writes nothing; nothing can "
                        "move. Go on?")) {
    return CommissioningResult::declined;
  }
  guard_.take_board();
  driver_.configure();
  for (const std::string& line : driver_.notes()) dialog_.tell("  " + line);
  for (const std::string& line : driver_.inspection()) dialog_.tell("  " + line);
  dialog_.tell("ok: compare version, supply, temperature and limits with your board's data sheet");
  return CommissioningResult::passed;
}

bool Commissioning::judge_turn(Wheel wheel, const WheelCounts& travel) {
  const bool upper = wheel == Wheel::upper;
  const std::string board(driver_.name());
  const std::int32_t turned = upper ? travel.upper : travel.lower;
  const std::int32_t other = upper ? travel.lower : travel.upper;
  const double turned_counts = least_turn * options_.encoder_counts_per_rev;
  const double turns = static_cast<double>(turned) / options_.encoder_counts_per_rev;
  if (std::abs(turned) < turned_counts && std::abs(other) >= turned_counts) {
    // The CAN node has fixed channels.
    const std::string fix = board == "can"
                                ? "exchange the two encoders at the node"
                                : "swap driver." + board + ".upper_channel and driver." + board + ".lower_channel";
    dialog_.tell("FAILED: the other wheel's counter moved: " + fix);
  } else if (std::abs(turned) < turned_counts) {
    dialog_.tell(formatted(
        "FAILED: %d counts are too few. Turn the wheel further, or check the encoder's cable and channel", turned));
  } else if (std::abs(other) > still_counts) {
    dialog_.tell(
        formatted("FAILED: the other wheel moved too, by %d counts: lift the upper wheel off the lower one", other));
  } else if (turned < 0) {
    dialog_.tell(formatted("FAILED: %d counts is the wrong direction: change the sign of driver.%s.%s_sign", turned,
                           board.c_str(), upper ? "upper" : "lower"));
  } else if (std::abs(turns - 1.0) > turn_tolerance) {
    dialog_.tell(
        formatted("FAILED: %d counts are %.3f turns at %d counts a turn (model.encoder_counts_per_rev). If it was "
                  "not one turn to within 3 %%, turn it again with a mark on its rim; if it was, correct that key: "
                  "with a wrong one all speeds and distances are wrong",
                  turned, turns, options_.encoder_counts_per_rev));
  } else {
    dialog_.tell(formatted("ok: %d counts forward, %.3f turns at %d counts a turn", turned, turns,
                           options_.encoder_counts_per_rev));
    (upper ? one_turn_.upper : one_turn_.lower) = turned;
    return true;
  }
  return false;
}

std::string Commissioning::step(int number) const {
  return formatted("Step %d of %d: ", number, driver_.watched_cable().empty() ? 4 : 5);
}

bool Commissioning::activate_and_rest() {
  // The guard looks at an idle board all the time. It must not while the driver sets the board up.
  guard_.begin();
  driver::IoResult rests{};
  try {
    driver_.activate(clock_.now_ns());
    rests = driver_.rest();
  } catch (...) {
    guard_.end(false);
    throw;
  }
  guard_.end(rests.ok());
  if (!rests.ok()) dialog_.tell("FAILED: the board's outputs are not off: " + reason_and_error(rests));
  return rests.ok();
}

CommissioningResult Commissioning::turn_by_hand() {
  if (!agrees(step(2) + "the program sets both PWMs and the counters to 0; then you turn the wheels by hand. Press the "
                        "E-stop and lift the upper wheel off the lower one. Go on?")) {
    return CommissioningResult::declined;
  }
  if (!activate_and_rest()) return CommissioningResult::failed;
  for (const Wheel wheel : {Wheel::upper, Wheel::lower}) {
    rig::Measurement before;
    rig::Measurement after;
    if (!read_fresh(before)) return CommissioningResult::failed;
    const std::string name = wheel == Wheel::upper ? "UPPER" : "LOWER";
    bool readable = true;
    if (!dialog_.wait_until_done("Turn the " + name +
                                     " wheel exactly one turn in the driving direction: mark its rim and "
                                     "bring the mark back to where it was, then press Enter",
                                 [&] { return readable = read(after); })) {
      return readable ? CommissioningResult::declined : CommissioningResult::failed;
    }
    clock_.sleep_until(clock_.now_ns() + watch_ns);  // an emulated wheel jumps: the driver doubts a jump in less time
    if (!read_fresh(after)) return CommissioningResult::failed;
    const WheelCounts travel = travel_between(before, after);
    if (!judge_turn(wheel, travel)) return CommissioningResult::failed;
  }
  return CommissioningResult::passed;
}

bool Commissioning::drive(const rig::Command& command, std::int64_t end_ns) {
  rig::Measurement now;
  for (std::int64_t tick_ns = clock_.now_ns(); tick_ns < end_ns && !stop_requested_(); tick_ns += cycle_ns) {
    clock_.sleep_until(tick_ns);
    if (!guard_.beat()) {
      dialog_.tell("FAILED: the guardian process has ended; the pulse was stopped");
      return false;
    }
    if (!read(now)) return false;
    if (clock_.now_ns() >= end_ns) break;
    if (const driver::IoResult result = driver_.write(command); !result.ok()) {
      dialog_.tell("FAILED: cannot write to the board: " + reason_and_error(result));
      return false;
    }
  }
  return true;
}

bool Commissioning::pulse(const rig::Command& command, WheelCounts& travel) {
  rig::Measurement first;
  rig::Measurement now;
  guard_.begin();
  bool good = read_fresh(first) && drive(command, clock_.now_ns() + std::llround(pulse_s / rig::s_per_ns));
  // A driver that failed has already made its outputs safe; it reports the result again.
  const bool active = driver_.state() == driver::DriverState::active;
  driver::IoResult ended = active ? driver_.write(rig::safe_command) : driver_.deactivate();
  if (active && ended.ok()) ended = driver_.rest();
  guard_.end(ended.ok());
  if (good && !ended.ok()) {
    dialog_.tell("FAILED: cannot end the pulse: " + reason_and_error(ended));
    good = false;
  }
  if (!good || !read_fresh(now)) return false;
  travel = travel_between(first, now);
  return true;
}

bool Commissioning::wait_for_standstill() {
  rig::Measurement last;
  if (!read_fresh(last)) return false;
  const std::int64_t limit_ns = clock_.now_ns() + std::llround(run_out_limit_s / rig::s_per_ns);
  std::int64_t still_since_ns = clock_.now_ns();
  while (clock_.now_ns() - still_since_ns < standstill_ns) {
    if (stop_requested_()) return false;
    if (clock_.now_ns() > limit_ns) {
      dialog_.tell("FAILED: the wheels still turn after the run-out limit");
      return false;
    }
    clock_.sleep_until(clock_.now_ns() + cycle_ns);
    rig::Measurement now;
    if (!read_fresh(now)) return false;
    if (now.upper_counts != last.upper_counts || now.lower_counts != last.lower_counts) {
      still_since_ns = clock_.now_ns();
    }
    last = now;
  }
  return true;
}

CommissioningResult Commissioning::drive_pulse() {
  if (!agrees(step(3) + formatted("the drive gets duty %.2f for %.2f s. Close the cover, stand clear and keep a hand "
                                  "at the E-stop; release the E-stop and let the upper wheel down. Go on?",
                                  options_.drive_duty, pulse_s))) {
    return CommissioningResult::declined;
  }
  WheelCounts travel;
  if (!pulse({.motor_duty = options_.drive_duty, .motor_enable = true}, travel)) {
    return CommissioningResult::failed;
  }
  if (stop_requested_()) return CommissioningResult::interrupted;
  if (travel.lower <= still_counts) {
    dialog_.tell(
        formatted("FAILED: the lower wheel moved %d counts. At 0: the E-stop is pressed, the rig is off, or the "
                  "duty is too small (--drive-duty). Below 0: motor polarity and encoder sign do not match",
                  travel.lower));
    return CommissioningResult::failed;
  }
  dialog_.tell(formatted("ok: lower wheel %d counts forward, upper wheel %d; waiting for both wheels to stop",
                         travel.lower, travel.upper));
  return wait_for_standstill() ? CommissioningResult::passed : CommissioningResult::failed;
}

CommissioningResult Commissioning::brake_pulse() {
  if (!agrees(
          step(driver_.watched_cable().empty() ? 4 : 5) +
          formatted("the upper wheel stands and its brake gets duty %.2f for %.2f s, then once more while "
                    "the program sends nothing for %.2f s, to see whether the board holds its outputs. Keep your hands "
                    "away from it. Go on?",
                    options_.brake_duty, pulse_s, silence_s))) {
    return CommissioningResult::declined;
  }
  WheelCounts travel;
  if (!pulse({.brake_duty = options_.brake_duty}, travel)) return CommissioningResult::failed;
  if (stop_requested_()) return CommissioningResult::interrupted;
  if (std::abs(travel.upper) > still_counts || std::abs(travel.lower) > still_counts) {
    dialog_.tell(
        formatted("FAILED: the brake pulse moved the upper wheel %d and the lower wheel %d counts, but a brake cannot "
                  "move a wheel: check whether drive and brake are exchanged",
                  travel.upper, travel.lower));
    return CommissioningResult::failed;
  }
  if (!measure_outputs()) return CommissioningResult::failed;
  if (stop_requested_()) return CommissioningResult::interrupted;
  dialog_.tell("ok: " + in_words(output_times_));
  return is_seen(options_.emulated
                     ? "Did the emulated brake grip and release? Nobody can see or hear it: look at the column "
                       "brake_torque_Nm of the emulator's --truth file."
                     : "Did you see or hear the brake grip and release?",
                 "check the brake's supply and cable, and the dead zone (plant.u0)");
}

CommissioningResult Commissioning::is_seen(const std::string& question, const char* fix) {
  const Answer answer = dialog_.ask(question);
  if (answer == Answer::no) dialog_.tell(std::string("FAILED: ") + fix);
  return answer == Answer::yes  ? CommissioningResult::passed
         : answer == Answer::no ? CommissioningResult::failed
                                : CommissioningResult::declined;
}

void Commissioning::watch_silence() {
  const std::int64_t silent_since_ns = clock_.now_ns();
  const std::int64_t end_ns = silent_since_ns + std::llround(silence_s / rig::s_per_ns);
  const auto silent_ms = [&] { return static_cast<double>(clock_.now_ns() - silent_since_ns) / rig::ns_per_ms; };
  rig::Command applied;
  while (clock_.now_ns() < end_ns && !stop_requested_() && guard_.beat()) {
    if (driver_.outputs_now(applied) && applied.brake_duty == 0.0 && applied.motor_duty == 0.0) {
      output_times_.watchdog_ms = silent_ms();
      return;
    }
    output_times_.watched_ms = silent_ms();
    clock_.sleep_until(clock_.now_ns() + cycle_ns);
  }
}

bool Commissioning::measure_outputs() {
  rig::Command applied;
  output_times_ = {.reported = driver_.outputs_now(applied)};
  if (!output_times_.reported) return true;
  constexpr std::int64_t set_ns = 20 * cycle_ns;
  guard_.begin();
  const bool driven = drive({.brake_duty = options_.brake_duty}, clock_.now_ns() + set_ns);
  if (driven) watch_silence();
  const std::int64_t ordered_ns = clock_.now_ns();
  const driver::IoResult ended = driver_.deactivate();
  output_times_.release_ms = static_cast<double>(clock_.now_ns() - ordered_ns) / rig::ns_per_ms;
  guard_.end(ended.ok());
  if (driven && !ended.ok()) dialog_.tell("FAILED: cannot end the pulse: " + reason_and_error(ended));
  return driven && ended.ok();
}

}  // namespace abs_hil::experiment
