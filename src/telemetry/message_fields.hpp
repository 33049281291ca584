#pragma once

#include <concepts>
#include <string_view>
#include <type_traits>

#include "abs_hil/adjustment_t.hpp"
#include "abs_hil/command2_t.hpp"
#include "abs_hil/command_state_t.hpp"
#include "abs_hil/command_t.hpp"
#include "abs_hil/event_t.hpp"
#include "abs_hil/experiment_t.hpp"
#include "abs_hil/measurement_t.hpp"
#include "abs_hil/status_t.hpp"
#include "abs_hil/telemetry_t.hpp"

namespace abs_hil::telemetry {

// What lcm-gen's C++ does not offer: the fields of each type by name, in the order in which they are encoded. A test
// holds every list against the generated encoder.

/// A message type or its const form.
template <class M, class Message>
concept Is = std::same_as<std::remove_const_t<M>, Message>;

template <Is<telemetry_t> M, class Visit>
void visit_fields(M& m, Visit&& visit) {
  visit("stamp_ns", m.stamp_ns);
  visit("sequence", m.sequence);
  visit("cycle", m.cycle);
  visit("time_s", m.time_s);
  visit("phase", m.phase);
  visit("reason", m.reason);
  visit("reason_value", m.reason_value);
  visit("omega1_rad_s", m.omega1_rad_s);
  visit("omega2_rad_s", m.omega2_rad_s);
  visit("omega1_est_rad_s", m.omega1_est_rad_s);
  visit("omega2_est_rad_s", m.omega2_est_rad_s);
  visit("slip", m.slip);
  visit("slip_est", m.slip_est);
  visit("slip_ref", m.slip_ref);
  visit("brake_torque_Nm", m.brake_torque_Nm);
  visit("brake_torque_ref_Nm", m.brake_torque_ref_Nm);
  visit("brake_torque_est_Nm", m.brake_torque_est_Nm);
  visit("brake_pwm", m.brake_pwm);
  visit("motor_pwm", m.motor_pwm);
  visit("motor_enable", m.motor_enable);
  visit("theta_N", m.theta_N);
  visit("theta_est_N", m.theta_est_N);
  visit("distance_m", m.distance_m);
  visit("slip_velocity_error_m_s", m.slip_velocity_error_m_s);
  visit("upper_counts", m.upper_counts);
  visit("lower_counts", m.lower_counts);
  visit("supply_V", m.supply_V);
  visit("temperature_C", m.temperature_C);
  visit("trip_flags", m.trip_flags);
  visit("wakeup_latency_ns", m.wakeup_latency_ns);
  visit("read_ns", m.read_ns);
  visit("control_ns", m.control_ns);
  visit("write_ns", m.write_ns);
  visit("cycle_ns", m.cycle_ns);
  visit("periods_skipped", m.periods_skipped);
  visit("record_ns", m.record_ns);
  visit("overrun_cause", m.overrun_cause);
}

template <Is<status_t> M, class Visit>
void visit_fields(M& m, Visit&& visit) {
  visit("stamp_ns", m.stamp_ns);
  visit("sequence", m.sequence);
  visit("time_s", m.time_s);
  visit("phase", m.phase);
  visit("cycles", m.cycles);
  visit("overruns", m.overruns);
  visit("telemetry_drops", m.telemetry_drops);
  visit("publish_failures", m.publish_failures);
  visit("realtime", m.realtime);
  visit("wakeup_latency_p50_us", m.wakeup_latency_p50_us);
  visit("wakeup_latency_p99_us", m.wakeup_latency_p99_us);
  visit("wakeup_latency_p99_9_us", m.wakeup_latency_p99_9_us);
  visit("wakeup_latency_max_us", m.wakeup_latency_max_us);
  visit("cycle_time_p50_us", m.cycle_time_p50_us);
  visit("cycle_time_p99_us", m.cycle_time_p99_us);
  visit("cycle_time_p99_9_us", m.cycle_time_p99_9_us);
  visit("cycle_time_max_us", m.cycle_time_max_us);
  visit("read_p50_us", m.read_p50_us);
  visit("read_p99_us", m.read_p99_us);
  visit("read_p99_9_us", m.read_p99_9_us);
  visit("read_max_us", m.read_max_us);
  visit("control_p50_us", m.control_p50_us);
  visit("control_p99_us", m.control_p99_us);
  visit("control_p99_9_us", m.control_p99_9_us);
  visit("control_max_us", m.control_max_us);
  visit("write_p50_us", m.write_p50_us);
  visit("write_p99_us", m.write_p99_us);
  visit("write_p99_9_us", m.write_p99_9_us);
  visit("write_max_us", m.write_max_us);
  visit("overruns_wakeup", m.overruns_wakeup);
  visit("overruns_read", m.overruns_read);
  visit("overruns_control", m.overruns_control);
  visit("overruns_write", m.overruns_write);
  visit("overruns_record", m.overruns_record);
  visit("overruns_startup", m.overruns_startup);
  visit("overruns_longest_run", m.overruns_longest_run);
  visit("ticks_missed", m.ticks_missed);
}

template <Is<event_t> M, class Visit>
void visit_fields(M& m, Visit&& visit) {
  visit("stamp_ns", m.stamp_ns);
  visit("sequence", m.sequence);
  visit("time_s", m.time_s);
  visit("kind", m.kind);
  visit("phase", m.phase);
  visit("reason", m.reason);
  visit("reason_text", m.reason_text);
  visit("value", m.value);
  visit("message", m.message);
}

template <Is<experiment_t> M, class Visit>
void visit_fields(M& m, Visit&& visit) {
  visit("stamp_ns", m.stamp_ns);
  visit("sequence", m.sequence);
  visit("experiment", m.experiment);
  visit("controller", m.controller);
  visit("plant", m.plant);
  visit("backend", m.backend);
  visit("config_json", m.config_json);
  visit("version", m.version);
}

template <Is<command_t> M, class Visit>
void visit_fields(M& m, Visit&& visit) {
  visit("stamp_ns", m.stamp_ns);
  visit("sequence", m.sequence);
  visit("command", m.command);
  visit("argument", m.argument);
  visit("token", m.token);
}

template <Is<measurement_t> M, class Visit>
void visit_fields(M& m, Visit&& visit) {
  visit("stamp_ns", m.stamp_ns);
  visit("sequence", m.sequence);
  visit("cycle", m.cycle);
  visit("measured_ns", m.measured_ns);
}

template <Is<adjustment_t> M, class Visit>
void visit_fields(M& m, Visit&& visit) {
  visit("stamp_ns", m.stamp_ns);
  visit("sequence", m.sequence);
  visit("cycle", m.cycle);
  visit("name", m.name);
  visit("value", m.value);
}

template <Is<command2_t> M, class Visit>
void visit_fields(M& m, Visit&& visit) {
  visit("stamp_ns", m.stamp_ns);
  visit("sequence", m.sequence);
  visit("session", m.session);
  visit("command", m.command);
  visit("name", m.name);
  visit("value", m.value);
  visit("sender", m.sender);
  visit("mac", m.mac);
}

template <Is<command_state_t> M, class Visit>
void visit_fields(M& m, Visit&& visit) {
  visit("stamp_ns", m.stamp_ns);
  visit("sequence", m.sequence);
  visit("enabled", m.enabled);
  visit("waiting", m.waiting);
  visit("session", m.session);
  visit("last_sequence", m.last_sequence);
  visit("stops", m.stops);
  visit("accepted", m.accepted);
  visit("refused", m.refused);
  visit("malformed", m.malformed);
  visit("dropped", m.dropped);
}

/// Name of a message type without its package, as in "telemetry_t".
template <class Message>
inline constexpr std::string_view type_name{};
template <>
inline constexpr std::string_view type_name<telemetry_t> = "telemetry_t";
template <>
inline constexpr std::string_view type_name<status_t> = "status_t";
template <>
inline constexpr std::string_view type_name<event_t> = "event_t";
template <>
inline constexpr std::string_view type_name<experiment_t> = "experiment_t";
template <>
inline constexpr std::string_view type_name<command_t> = "command_t";
template <>
inline constexpr std::string_view type_name<measurement_t> = "measurement_t";
template <>
inline constexpr std::string_view type_name<adjustment_t> = "adjustment_t";
template <>
inline constexpr std::string_view type_name<command2_t> = "command2_t";
template <>
inline constexpr std::string_view type_name<command_state_t> = "command_state_t";

/// Calls `use.template operator()<Message>()` for every message type.
template <class Use>
void for_each_message_type(Use&& use) {
  use.template operator()<telemetry_t>();
  use.template operator()<status_t>();
  use.template operator()<event_t>();
  use.template operator()<experiment_t>();
  use.template operator()<command_t>();
  use.template operator()<measurement_t>();
  use.template operator()<adjustment_t>();
  use.template operator()<command2_t>();
  use.template operator()<command_state_t>();
}

}  // namespace abs_hil::telemetry
