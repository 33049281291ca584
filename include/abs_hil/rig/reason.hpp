#pragma once

#include <cstdint>
#include <string_view>

namespace abs_hil::rig {

/// Why a phase changed, a command was refused or a run ended. Plain numbers, so that the real-time thread can hand them
/// on without a string; `description` turns them into words where there is time. Append only: logs hold the numbers.
enum class Reason : std::uint16_t {
  none = 0,
  // the sequence goes on
  run_started = 1,
  start_speed_given = 2,
  speed_threshold_reached = 3,
  upper_wheel_peak_detected = 4,
  phase_duration_over = 5,
  end_speed_reached = 6,
  standstill_reached = 7,
  sequence_complete = 8,
  slip_control_left_at_low_speed = 9,
  speed_condition_met = 20,
  slip_condition_met = 21,
  distance_reached = 22,
  all_conditions_met = 23,
  // the run ends early because somebody asked for it
  interrupt_signal = 32,
  terminate_signal = 33,
  stop_command = 34,
  hangup_signal = 35,
  // the run goes on, changed by a command
  gain_changed = 37,
  slip_reference_changed = 38,
  start_command = 39,
  // why a command is refused; the run goes on
  commands_not_enabled = 40,
  command_not_authentic = 41,
  command_repeated = 42,
  command_unknown = 43,
  command_out_of_range = 44,
  command_malformed = 45,
  command_not_now = 46,
  // the run ends early by a fault or limit
  phase_time_limit = 64,
  overspeed = 65,
  command_not_finite = 66,
  estimate_not_finite = 67,
  driver_read_failed = 68,
  driver_write_failed = 69,
  board_interlock_tripped = 70,
  consecutive_overruns = 71,
  board_supply_tripped = 80,
  board_supply_low = 81,
  board_too_hot = 82,
  can_node_silent = 100,
  can_frames_stale = 101,
  can_frames_duplicated = 102,
  can_frames_out_of_order = 103,
  can_frame_wrong_length = 104,
  can_frames_forged = 105,
  can_values_implausible = 106,
  can_too_many_frames = 107,
  can_send_queue_full = 108,
  can_bus_off = 109,
  can_error_passive = 110,
  can_interface_down = 111,
  can_node_latched = 112,
  can_node_restarted = 113,
  can_outputs_not_taken = 114,
  usb_unplugged = 120,
  usb_stalled = 121,
  usb_short_frame = 122,
  usb_no_answer = 123,
  usb_not_a_frame = 124,
  usb_outputs_not_taken = 125,
  usb_transfer_failed = 126,
  // what the gate's plausibility checks find (docs/safety.md)
  encoder_upper_stuck = 130,
  encoder_lower_stuck = 131,
  encoder_upper_jumped = 132,
  encoder_lower_jumped = 133,
  encoder_upper_reversed = 134,
  encoder_lower_reversed = 135,
  encoders_lost = 136,
  encoders_disagree = 137,
  slip_implausible = 138,
  samples_missing = 139,
  speed_rises_with_motor_off = 140,
  motor_no_response = 141,
  brake_no_response = 142,
  board_health_lost = 143,
  // the guardian, and what it acts upon (docs/dead-man.md)
  guardian_died = 160,
  guardian_silent = 161,
  controller_died = 162,
  controller_silent = 163,
  safe_state_unverified = 164,
  // limits of an experiment's script
  run_time_limit = 200,
  run_distance_limit = 201,
};

/// In words, for events, logs and summaries.
[[nodiscard]] constexpr std::string_view description(Reason reason) noexcept {
  switch (reason) {
    case Reason::none: return "none";
    case Reason::run_started: return "run started";
    case Reason::start_speed_given: return "braking starts at once from the given start speed";
    case Reason::speed_threshold_reached: return "upper wheel reached its speed threshold";
    case Reason::upper_wheel_peak_detected: return "upper wheel stopped gaining speed";
    case Reason::phase_duration_over: return "phase lasted its set time";
    case Reason::end_speed_reached: return "car speed below the experiment's end speed";
    case Reason::standstill_reached: return "both wheels stand still";
    case Reason::sequence_complete: return "experiment ran to its end";
    case Reason::slip_control_left_at_low_speed: return "car speed below the least speed for slip control";
    case Reason::speed_condition_met: return "speed reached the value that ends the phase";
    case Reason::slip_condition_met: return "slip reached the value that ends the phase";
    case Reason::distance_reached: return "car came the distance that ends the phase";
    case Reason::all_conditions_met: return "all conditions that end the phase hold";
    case Reason::interrupt_signal: return "interrupted (SIGINT)";
    case Reason::terminate_signal: return "terminated (SIGTERM)";
    case Reason::stop_command: return "stopped by a command on ABS_COMMAND";
    case Reason::hangup_signal: return "terminal closed (SIGHUP)";
    case Reason::gain_changed: return "gain changed by a command";
    case Reason::slip_reference_changed: return "slip reference changed by a command";
    case Reason::start_command: return "started by a command";
    case Reason::commands_not_enabled: return "commands other than stop are not enabled";
    case Reason::command_not_authentic: return "command does not prove that its sender may give it";
    case Reason::command_repeated: return "command was received before";
    case Reason::command_unknown: return "command is not known";
    case Reason::command_out_of_range: return "command's value is out of range";
    case Reason::command_malformed: return "packet is no command";
    case Reason::command_not_now: return "command cannot be carried out now";
    case Reason::phase_time_limit: return "phase exceeded its time limit";
    case Reason::overspeed: return "wheel speed above the limit";
    case Reason::command_not_finite: return "command was not a finite number";
    case Reason::estimate_not_finite: return "speed estimate was not a finite number";
    case Reason::driver_read_failed: return "reading the board failed";
    case Reason::driver_write_failed: return "writing to the board failed";
    case Reason::board_interlock_tripped: return "the board's own interlock tripped";
    case Reason::consecutive_overruns: return "too many consecutive overruns";
    case Reason::board_supply_tripped: return "the board's own interlock tripped: supply undervoltage";
    case Reason::board_supply_low: return "the board's supply is below gate.supply_min_V";
    case Reason::board_too_hot: return "the board is hotter than gate.temperature_max_C";
    case Reason::can_node_silent: return "CAN node did not answer too often: its watchdog takes the outputs to zero";
    case Reason::can_frames_stale: return "CAN node answers with old sequence numbers";
    case Reason::can_frames_duplicated: return "CAN frames come twice: two nodes, or one that repeats itself";
    case Reason::can_frames_out_of_order: return "CAN frames come out of order or ahead of what was asked";
    case Reason::can_frame_wrong_length: return "CAN frames have the wrong length";
    case Reason::can_frames_forged: return "CAN frames with the node's identifiers are not the node's (wrong check)";
    case Reason::can_values_implausible: return "CAN node sends values that cannot be";
    case Reason::can_too_many_frames: return "CAN frames come faster than they can be read";
    case Reason::can_send_queue_full: return "CAN interface takes no more frames: the bus is blocked";
    case Reason::can_bus_off: return "CAN controller is bus-off";
    case Reason::can_error_passive: return "CAN controller is error-passive";
    case Reason::can_interface_down: return "CAN interface is down or gone";
    case Reason::can_node_latched: return "CAN node has cut its outputs by itself";
    case Reason::can_node_restarted: return "CAN node was restarted or replaced";
    case Reason::can_outputs_not_taken: return "CAN node does not apply the duties that were sent";
    case Reason::usb_unplugged: return "USB board unplugged: its outputs hold, press the E-stop";
    case Reason::usb_stalled: return "USB board refused a transfer (STALL)";
    case Reason::usb_short_frame: return "USB board sent a frame of the wrong length";
    case Reason::usb_no_answer:
      return "USB board did not answer in time too often: its outputs may hold, press the E-stop";
    case Reason::usb_not_a_frame: return "USB board sent what is none of its frames";
    case Reason::usb_outputs_not_taken: return "USB board does not show the duties that were sent";
    case Reason::usb_transfer_failed: return "USB transfer failed";
    case Reason::encoder_upper_stuck: return "upper wheel's encoder stands still though the wheel cannot";
    case Reason::encoder_lower_stuck: return "lower wheel's encoder stands still though the wheel cannot";
    case Reason::encoder_upper_jumped: return "upper wheel's encoder shows speeds that the wheel cannot have";
    case Reason::encoder_lower_jumped: return "lower wheel's encoder shows speeds that the wheel cannot have";
    case Reason::encoder_upper_reversed: return "upper wheel's encoder counts backwards";
    case Reason::encoder_lower_reversed: return "lower wheel's encoder counts backwards";
    case Reason::encoders_lost: return "both encoders stand still though the wheels cannot";
    case Reason::encoders_disagree: return "wheels differ in speed with the brake long released: an encoder drifts";
    case Reason::slip_implausible:
      return "slip outside what the tyre can do: the braked wheel is the faster one (encoders swapped?)";
    case Reason::samples_missing: return "no fresh measurement";
    case Reason::speed_rises_with_motor_off: return "wheels gain speed with the motor off";
    case Reason::motor_no_response: return "motor on and the wheels do not gain speed";
    case Reason::brake_no_response: return "brake on and the wheels do not lose speed";
    case Reason::board_health_lost: return "the board no longer reports its supply or temperature";
    case Reason::guardian_died: return "the guardian process died; without it nothing may move";
    case Reason::guardian_silent: return "the guardian process gave no sign of life; without it nothing may move";
    case Reason::controller_died: return "the controller process died";
    case Reason::controller_silent: return "the controller gave no sign of life for guardian.timeout_ms";
    case Reason::safe_state_unverified: return "the controller could not verify the safe state";
    case Reason::run_time_limit: return "run exceeded the experiment's time limit";
    case Reason::run_distance_limit: return "car came further than the experiment's limit";
  }
  return "unknown reason";
}

/// True for reasons that latch: the run is over and only a new one goes on.
[[nodiscard]] constexpr bool is_fault(Reason reason) noexcept {
  return static_cast<std::uint16_t>(reason) >= static_cast<std::uint16_t>(Reason::phase_time_limit);
}

/// True for changes that a command made to a run that goes on.
[[nodiscard]] constexpr bool is_adjustment(Reason reason) noexcept {
  return reason == Reason::gain_changed || reason == Reason::slip_reference_changed || reason == Reason::start_command;
}

/// True for reasons that come from outside: a signal or a stop command.
[[nodiscard]] constexpr bool is_stop_request(Reason reason) noexcept {
  return reason == Reason::interrupt_signal || reason == Reason::terminate_signal || reason == Reason::stop_command ||
         reason == Reason::hangup_signal;
}

}  // namespace abs_hil::rig
