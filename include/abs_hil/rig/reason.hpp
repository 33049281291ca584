#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace abs_hil::rig {

/// Effect of a reason on a run.
enum class ReasonKind : std::uint8_t {
  none,          ///< nothing happened
  sequence,      ///< the experiment enters its next phase or ends as planned
  stop_request,  ///< a signal or a stop command ends the run
  adjustment,    ///< a command changed the run; the run goes on
  refusal,       ///< a command was refused; the run goes on
  fault,         ///< a fault or limit ended the run; only a new run can follow
};

/// Whether a replay reproduces the reason from the recorded measurements.
enum class ReplayFinds : std::uint8_t {
  no,             ///< it comes from outside: a person, a board, the bus, the operating system
  yes,            ///< sequence, gate or logic find it; the replay repeats recorded adjustments
  wheel_checks,   ///< the gate's checks of the wheels find it, if the recorded commands are those that acted on the rig
  jumped_counts,  ///< as wheel_checks, unless the gate refused the counts: the recording does not contain refused
                  ///< counts
};

// clang-format off
/// Every reason: name, number, kind, found again, text. If the reason has a value, then its quantity, its unit and its
/// bound follow: a configuration key, or words. Logs contain the numbers: add rows, but never renumber them.
#define ABS_HIL_REASONS(ROW)                                                                                          \
  ROW(none, 0, none, yes, "none")                                                                                     \
  ROW(run_started, 1, sequence, yes, "run started",                                                                   \
      "speed of the lower wheel", "rad/s", "")                                                                        \
  ROW(start_speed_given, 2, sequence, yes, "braking starts at once from the given start speed")                       \
  ROW(speed_threshold_reached, 3, sequence, yes, "upper wheel reached its speed threshold",                           \
      "speed at least", "rad/s", "the phase's until")                                                                 \
  ROW(upper_wheel_peak_detected, 4, sequence, yes, "upper wheel stopped gaining speed",                               \
      "time without a new maximum", "s", "the phase's until")                                                         \
  ROW(phase_duration_over, 5, sequence, yes, "phase lasted its set time",                                             \
      "time in the phase", "s", "the phase's until")                                                                  \
  ROW(end_speed_reached, 6, sequence, yes, "car speed below the experiment's end speed",                              \
      "car speed at most", "m/s", "the phase's until")                                                                \
  ROW(standstill_reached, 7, sequence, yes, "both wheels stand still")                                                \
  ROW(sequence_complete, 8, sequence, yes, "experiment ran to its end",                                               \
      "run time", "s", "")                                                                                            \
  ROW(slip_control_left_at_low_speed, 9, sequence, yes, "car speed below the least speed for slip control",           \
      "car speed at most", "m/s", "control.v_min_m_s")                                                                \
  ROW(speed_condition_met, 20, sequence, yes, "speed reached the value that ends the phase")                          \
  ROW(slip_condition_met, 21, sequence, yes, "slip reached the value that ends the phase",                            \
      "slip", "", "the phase's until")                                                                                \
  ROW(distance_reached, 22, sequence, yes, "car covered the distance that ends the phase",                            \
      "distance in the phase", "m", "the phase's until")                                                              \
  ROW(all_conditions_met, 23, sequence, yes, "all conditions that end the phase hold")                                \
  ROW(question_answered, 24, adjustment, yes, "the phase's question was answered")                                        \
  ROW(interrupt_signal, 32, stop_request, no, "interrupted (SIGINT)")                                                 \
  ROW(terminate_signal, 33, stop_request, no, "terminated (SIGTERM)")                                                 \
  ROW(stop_command, 34, stop_request, no, "stopped by a command on ABS_COMMAND")                                      \
  ROW(hangup_signal, 35, stop_request, no, "terminal closed (SIGHUP)")                                                \
  ROW(gain_changed, 37, adjustment, yes, "gain changed by a command")                                                 \
  ROW(slip_reference_changed, 38, adjustment, yes, "slip reference changed by a command")                             \
  ROW(start_command, 39, adjustment, yes, "started by a command")                                                     \
  ROW(commands_not_enabled, 40, refusal, no, "commands other than stop are not enabled")                              \
  ROW(command_not_authentic, 41, refusal, no, "command is not authenticated")                                         \
  ROW(command_repeated, 42, refusal, no, "command was received before")                                               \
  ROW(command_unknown, 43, refusal, no, "command is not known")                                                       \
  ROW(command_out_of_range, 44, refusal, no, "command's value is out of range")                                       \
  ROW(command_malformed, 45, refusal, no, "packet does not hold a command")                                           \
  ROW(command_not_now, 46, refusal, no, "command cannot be carried out now")                                          \
  ROW(phase_time_limit, 64, fault, yes, "phase exceeded its time limit",                                              \
      "time in the phase", "s", "the phase's at_most_s")                                                              \
  ROW(overspeed, 65, fault, yes, "wheel speed above the limit",                                                       \
      "speed", "rad/s", "gate.overspeed_rad_s")                                                                       \
  ROW(command_not_finite, 66, fault, yes, "command was not a finite number")                                          \
  ROW(estimate_not_finite, 67, fault, yes, "speed estimate was not a finite number")                                  \
  ROW(driver_read_failed, 68, fault, no, "reading the board failed")                                                  \
  ROW(driver_write_failed, 69, fault, no, "writing to the board failed")                                              \
  ROW(board_interlock_tripped, 70, fault, yes, "the board's own interlock tripped",                                   \
      "trip flags", "", "0")                                                                                          \
  ROW(consecutive_overruns, 71, fault, no, "too many late cycles in a row, or late for longer than realtime.late_max_s", \
      "late cycles in a row", "")                                                \
  ROW(board_supply_tripped, 80, fault, yes, "the board's own interlock tripped: supply undervoltage",                 \
      "trip flags", "", "0")                                                                                          \
  ROW(board_supply_low, 81, fault, yes, "the board's supply is off or below gate.supply_min_V",                              \
      "supply", "V", "gate.supply_min_V")                                                                             \
  ROW(board_too_hot, 82, fault, yes, "the board is hotter than gate.temperature_max_C",                               \
      "temperature", "degrees Celsius", "gate.temperature_max_C")                                                     \
  ROW(foreign_writer, 83, fault, no,                                                                                  \
      "an output did not keep the value that was sent: something else writes to the board or talks to it, or its "      \
      "logic restarted")   \
  ROW(board_reconfigured, 84, fault, no,                                                                              \
      "the board's version or settings changed during the run: its logic was loaded again, or something else writes " \
      "to it")                                                                                                        \
  ROW(can_node_silent, 100, fault, no, "CAN node missed too many answers; its watchdog sets the outputs to zero")     \
  ROW(can_frames_stale, 101, fault, no, "CAN node answers with old sequence numbers")                                 \
  ROW(can_frames_duplicated, 102, fault, no, "CAN frames arrive twice: two nodes answer, or one repeats itself")      \
  ROW(can_frames_out_of_order, 103, fault, no,                                                                        \
      "CAN frames arrive out of order or answer requests that were not sent")                                         \
  ROW(can_frame_wrong_length, 104, fault, no, "CAN frames have the wrong length")                                     \
  ROW(can_frames_forged, 105, fault, no,                                                                              \
      "CAN frames with the node's identifiers have a wrong check value: another sender")                              \
  ROW(can_values_implausible, 106, fault, no, "CAN node sends impossible values")                                     \
  ROW(can_too_many_frames, 107, fault, no, "CAN frames arrive faster than the program can read them")                 \
  ROW(can_send_queue_full, 108, fault, no, "CAN interface accepts no more frames: the bus is blocked")                \
  ROW(can_bus_off, 109, fault, no, "CAN controller is bus-off")                                                       \
  ROW(can_error_passive, 110, fault, no, "CAN controller is error-passive")                                           \
  ROW(can_interface_down, 111, fault, no, "CAN interface is down or gone")                                            \
  ROW(can_node_latched, 112, fault, no, "CAN node switched its outputs off by itself")                                \
  ROW(can_node_restarted, 113, fault, no, "CAN node was restarted or replaced")                                       \
  ROW(can_outputs_not_taken, 114, fault, no, "CAN node does not apply the duties that were sent")                     \
  ROW(usb_unplugged, 120, fault, no, "USB board unplugged: its outputs keep their last values, press the E-stop")     \
  ROW(usb_stalled, 121, fault, no, "USB board refused a transfer (STALL)")                                            \
  ROW(usb_short_frame, 122, fault, no, "USB board sent a frame of the wrong length")                                  \
  ROW(usb_no_answer, 123, fault, no,                                                                                  \
      "USB board missed too many answers: its outputs may keep their last values, press the E-stop")                  \
  ROW(usb_not_a_frame, 124, fault, no, "USB board sent data that is not one of its frames")                           \
  ROW(usb_outputs_not_taken, 125, fault, no, "USB board does not show the duties that were sent")                     \
  ROW(usb_transfer_failed, 126, fault, no, "USB transfer failed")                                                     \
  ROW(encoder_upper_stuck, 130, fault, wheel_checks,                                                                  \
      "upper wheel's encoder shows standstill, but the wheel must be turning",                                        \
      "speed by its counts", "rad/s", "what brake, tyre and the speed before permit")                                 \
  ROW(encoder_lower_stuck, 131, fault, wheel_checks,                                                                  \
      "lower wheel's encoder shows standstill, but the wheel must be turning",                                        \
      "speed by its counts", "rad/s", "what motor, tyre and the speed before permit")                                 \
  ROW(encoder_upper_jumped, 132, fault, jumped_counts,                                                                \
      "upper wheel's encoder shows speeds that the wheel cannot reach",                                               \
      "angle or speed by its counts", "rad or rad/s", "what brake, tyre and the speed before permit")                 \
  ROW(encoder_lower_jumped, 133, fault, jumped_counts,                                                                \
      "lower wheel's encoder shows speeds that the wheel cannot reach",                                               \
      "angle or speed by its counts", "rad or rad/s", "what motor, tyre and the speed before permit")                 \
  ROW(encoder_upper_reversed, 134, fault, wheel_checks,                                                               \
      "upper wheel's encoder counts backwards: exchange its lines A and B, or negate the board's upper_sign",             \
      "speed by its counts", "rad/s", "0")                                                                            \
  ROW(encoder_lower_reversed, 135, fault, wheel_checks,                                                               \
      "lower wheel's encoder counts backwards: exchange its lines A and B, or negate the board's lower_sign",             \
      "speed by its counts", "rad/s", "0")                                                                            \
  ROW(encoders_lost, 136, fault, wheel_checks, "both encoders show standstill, but the wheels must be turning")       \
  ROW(encoders_disagree, 137, fault, wheel_checks,                                                                    \
      "wheel speeds differ long after the brake was released: an encoder is wrong, or the tyre has little grip",      \
      "speed of the upper rim less that of the lower", "m/s", "that of a freely rolling tyre")                        \
  ROW(slip_implausible, 138, fault, wheel_checks,                                                                     \
      "slip is outside the range of the tyre: the braked wheel turns faster than the other (encoders swapped?)",      \
      "slip", "", "0")                                                                                                \
  ROW(samples_missing, 139, fault, wheel_checks, "no fresh measurement",                                              \
      "time without a fresh measurement", "s", "gate.sample_age_max_s")                                               \
  ROW(speed_rises_with_motor_off, 140, fault, wheel_checks, "the wheels gain speed although the motor is off",        \
      "momentum gained, at the rim", "kg m/s", "0")                                                                   \
  ROW(motor_no_response, 141, fault, wheel_checks,                                                                    \
      "the motor is on, but the wheels do not gain speed: check E-stop, drive switch and supply, then the encoders",  \
      "momentum gained, at the rim", "kg m/s", "a part of the motor's impulse")                                       \
  ROW(brake_no_response, 142, fault, wheel_checks, "the brake is on, but the wheels do not lose speed",               \
      "momentum gained, at the rim", "kg m/s", "a part of the brake's impulse, below 0")                              \
  ROW(board_health_lost, 143, fault, yes, "the board no longer reports its supply or temperature")                    \
  ROW(guardian_died, 160, fault, no, "the guardian process died; the rig may not move without it")                    \
  ROW(guardian_silent, 161, fault, no, "the guardian process gave no sign of life; the rig may not move without it",  \
      "cycles without its sign of life", "", "guardian.timeout_ms")                                                   \
  ROW(controller_died, 162, fault, no, "the controller process died")                                                 \
  ROW(controller_silent, 163, fault, no, "the controller gave no sign of life for guardian.timeout_ms")               \
  ROW(safe_state_unverified, 164, fault, no, "the controller could not verify the safe state")                        \
  ROW(run_time_limit, 200, fault, yes, "run exceeded the experiment's time limit",                                    \
      "run time", "s", "the experiment's run_time_s")                                                                 \
  ROW(run_distance_limit, 201, fault, yes, "car went further than the experiment's limit",                            \
      "distance", "m", "the experiment's distance_m")                                                                 \
  ROW(controller_not_finite, 210, fault, yes, "the controller's output was not a finite number")                      \
  ROW(checks_cannot_judge, 220, fault, wheel_checks,                                                                  \
      "the plausibility checks could not judge the wheels for gate.judge_within_s: readings are too slow or stale, "  \
      "or the encoders have too few counts",                                                                          \
      "time without a verdict", "s", "gate.judge_within_s")                                                           \
  ROW(cycle_gap, 221, fault, no,                                                                                      \
      "no cycle ran for longer than realtime.cycle_gap_max_s (by default guardian.timeout_ms) while an output was "   \
      "on: the program was stopped, frozen or kept from the processor, or the board took that long",                                                                            \
      "time from one cycle to the next", "s", "realtime.cycle_gap_max_s")                                             \
  ROW(computer_suspended, 222, fault, no, "the computer was suspended while an output was on",                        \
      "time suspended", "s", "0")                                                                                     \
  ROW(released_wheel_stands, 223, fault, wheel_checks,                                                                \
      "the upper wheel shows standstill although the brake has let go: its encoder is stuck, or the brake holds on",  \
      "time at standstill", "s", "what a tyre with little grip needs to turn it")                                     \
  ROW(question_unanswered, 224, fault, yes, "nobody answered the phase's question in time",                           \
      "time in the phase", "s", "the phase's at_most_s")                                                              \
  ROW(braking_without_stop, 230, fault, no,                                                                           \
      "the experiment ran to its end, but the car was still faster than experiment.end_speed_m_s",                    \
      "car speed", "m/s", "experiment.end_speed_m_s")                                                                 \
  ROW(hm2_silent, 240, fault, no,                                                                                     \
      "hm2 board and program lost ten datagrams in a row, or too many: the board's watchdog drops all outputs")                    \
  ROW(hm2_watchdog_bit, 241, fault, no,                                                                               \
      "hm2 board's watchdog dropped all outputs: no command came in its time, or somebody made it bite")                                        \
  ROW(hm2_outputs_off, 242, fault, no, "hm2 board's pins are no longer the outputs that were set up (DDR)")           \
  ROW(hm2_quadrature_error, 243, fault, no,                                                                           \
      "hm2 board's counter saw both signals of an encoder change at once: encoder, cable or interference")            \
  ROW(hm2_values_implausible, 244, fault, no, "hm2 board sends counts that the wheels cannot reach")                  \
  ROW(hm2_restarted, 245, fault, no, "hm2 board was restarted: its supply or its program")                            \
  ROW(lease_closed, 250, fault, no,                                                                                   \
      "the controller closed its connection to the resident guardian while it had the outputs")                       \
  ROW(guardian_paused, 251, fault, no,                                                                                \
      "the guardian was kept from running for twice guardian.timeout_ms: it took the outputs back")                   \
  ROW(machine_paused, 253, fault, no,                                                                                 \
      "the virtual machine was paused: the board's clock ran on while this computer stood still")                     \
  ROW(guardian_told_to_end, 254, fault, no, "the resident guardian was told to end")                                  \
  ROW(made_safe_on_request, 255, fault, no, "somebody had the board made safe (abs_hil safe)")                        \
  /* the end of the rows */
// clang-format on

/// Why a phase changed, a command was refused or a run ended. These are plain numbers, so that the real-time thread
/// needs no strings.
enum class Reason : std::uint16_t {
#define ABS_HIL_REASON_NUMBER(name, number, ...) name = number,
  ABS_HIL_REASONS(ABS_HIL_REASON_NUMBER)
#undef ABS_HIL_REASON_NUMBER
};

/// What the value of a reason is.
struct ReasonValue {
  std::string_view quantity{};  ///< empty: the reason has no value that tells a person anything
  std::string_view unit{};
  std::string_view bound{};  ///< what it is compared with: a configuration key, or words; empty: nothing
};

/// A row of the table.
struct ReasonRow {
  std::string_view name;
  Reason reason;
  ReasonKind kind;
  ReplayFinds found_again;
  std::string_view text;  ///< in words, for events, logs and summaries
  ReasonValue value{};
};

inline constexpr std::array reasons{
#define ABS_HIL_REASON_ROW(name, number, kind, found_again, text, ...) \
  ReasonRow{#name, Reason::name, ReasonKind::kind, ReplayFinds::found_again, text, ReasonValue{__VA_ARGS__}},
    ABS_HIL_REASONS(ABS_HIL_REASON_ROW)
#undef ABS_HIL_REASON_ROW
};

#undef ABS_HIL_REASONS

namespace detail {

/// All numbers from here on are faults, also those of later versions.
inline constexpr std::uint16_t first_fault = 64;
static_assert(std::ranges::all_of(reasons, [](const ReasonRow& row) {
  return (row.kind == ReasonKind::fault) == (static_cast<std::uint16_t>(row.reason) >= first_fault);
}));
static_assert(std::ranges::adjacent_find(reasons,
                                         [](const ReasonRow& a, const ReasonRow& b) { return a.reason >= b.reason; }) ==
                  reasons.end(),
              "the rows stand in the order of their numbers, and no number comes twice");

inline constexpr ReasonRow unknown_event{"unknown", Reason::none, ReasonKind::none, ReplayFinds::no, "unknown reason"};
inline constexpr ReasonRow unknown_fault{"unknown", Reason::none, ReasonKind::fault, ReplayFinds::no, "unknown reason"};

inline constexpr std::size_t numbers = static_cast<std::size_t>(reasons.back().reason) + 1;
/// Index of each number's row in `reasons`; reasons.size() for a number without a row.
inline constexpr auto places = [] {
  static_assert(reasons.size() < 256);
  std::array<std::uint8_t, numbers> place{};
  place.fill(static_cast<std::uint8_t>(reasons.size()));
  for (std::size_t n = 0; n < reasons.size(); ++n) {
    place[static_cast<std::size_t>(reasons[n].reason)] = static_cast<std::uint8_t>(n);
  }
  return place;
}();

}  // namespace detail

/// The reason's row. For a number that this version does not know, a row that says so. Real-time safe.
[[nodiscard]] constexpr const ReasonRow& row_of(Reason reason) noexcept {
  const auto number = static_cast<std::size_t>(reason);
  if (number < detail::numbers && detail::places[number] < reasons.size()) return reasons[detail::places[number]];
  return number < detail::first_fault ? detail::unknown_event : detail::unknown_fault;
}

/// In words, for events, logs and summaries.
[[nodiscard]] constexpr std::string_view description(Reason reason) noexcept { return row_of(reason).text; }

/// True for reasons that latch: the run has ended, and only a new run can follow.
[[nodiscard]] constexpr bool is_fault(Reason reason) noexcept { return row_of(reason).kind == ReasonKind::fault; }

/// True for changes by a command after which the run goes on.
[[nodiscard]] constexpr bool is_adjustment(Reason reason) noexcept {
  return row_of(reason).kind == ReasonKind::adjustment;
}

/// True for reasons that come from outside: a signal or a stop command.
[[nodiscard]] constexpr bool is_stop_request(Reason reason) noexcept {
  return row_of(reason).kind == ReasonKind::stop_request;
}

[[nodiscard]] constexpr std::string_view name_of(ReasonKind kind) noexcept {
  constexpr std::array<std::string_view, 6> names{"none", "sequence", "stop request", "adjustment", "refusal", "fault"};
  return names[static_cast<std::size_t>(kind)];
}

[[nodiscard]] constexpr std::string_view name_of(ReplayFinds found_again) noexcept {
  constexpr std::array<std::string_view, 4> names{"no", "yes", "wheel checks", "wheel checks, not jumped counts"};
  return names[static_cast<std::size_t>(found_again)];
}

}  // namespace abs_hil::rig
