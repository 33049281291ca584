#include "telemetry/message_codec.hpp"

#include <bit>
#include <limits>

#include "telemetry/checked_decode.hpp"

namespace abs_hil::telemetry {
namespace {

static_assert(std::numeric_limits<double>::is_iec559);
static_assert(telemetry_t::PHASE_IDLE == static_cast<int>(rig::Phase::idle));
static_assert(telemetry_t::PHASE_ACCELERATE == static_cast<int>(rig::Phase::accelerate));
static_assert(telemetry_t::PHASE_COAST == static_cast<int>(rig::Phase::coast));
static_assert(telemetry_t::PHASE_BRAKE == static_cast<int>(rig::Phase::brake));
static_assert(telemetry_t::PHASE_HOLD == static_cast<int>(rig::Phase::hold));
static_assert(telemetry_t::PHASE_STOPPED == static_cast<int>(rig::Phase::stopped));
static_assert(telemetry_t::PHASE_FAULT == static_cast<int>(rig::Phase::fault));

}  // namespace

telemetry_t to_message(const rig::CycleRecord& record, double distance_m, std::int64_t sequence) noexcept {
  telemetry_t m{};
  m.stamp_ns = record.stamp_ns;
  m.sequence = sequence;
  m.cycle = std::bit_cast<std::int64_t>(record.sequence);
  m.time_s = record.time_s;
  m.phase = static_cast<std::int8_t>(record.phase);
  m.reason = static_cast<std::int16_t>(record.reason);
  m.reason_value = record.reason_value;

  m.omega1_rad_s = record.truth.speeds.omega1_rad_s;
  m.omega2_rad_s = record.truth.speeds.omega2_rad_s;
  m.omega1_est_rad_s = record.control.speeds_est.omega1_rad_s;
  m.omega2_est_rad_s = record.control.speeds_est.omega2_rad_s;
  m.slip = record.truth.slip;
  m.slip_est = record.control.slip_est;
  m.slip_ref = record.control.slip_ref;
  m.brake_torque_Nm = record.truth.brake_torque_Nm;
  m.brake_torque_ref_Nm = record.control.brake_torque_ref_Nm;
  m.brake_torque_est_Nm = record.control.brake_torque_est_Nm;
  m.brake_pwm = record.command.brake_duty;
  m.motor_pwm = record.command.motor_duty;
  m.motor_enable = static_cast<std::int8_t>(record.command.motor_enable);
  m.theta_N = record.truth.theta_N;
  m.theta_est_N = record.control.theta_est_N;
  m.distance_m = distance_m;
  m.slip_velocity_error_m_s = record.control.slip_velocity_error_m_s;

  m.upper_counts = record.measurement.upper_counts;
  m.lower_counts = record.measurement.lower_counts;
  m.supply_V = record.measurement.supply_V;
  m.temperature_C = record.measurement.temperature_C;
  m.trip_flags = record.measurement.trip_flags;

  m.wakeup_latency_ns = record.timing.wakeup_latency_ns;
  m.read_ns = record.timing.read_ns;
  m.control_ns = record.timing.control_ns;
  m.write_ns = record.timing.write_ns;
  m.cycle_ns = record.timing.cycle_ns;
  m.periods_skipped = record.timing.periods_skipped;
  m.record_ns = record.timing.record_ns;
  m.overrun_cause = static_cast<std::int8_t>(record.timing.overrun_cause);
  return m;
}

rig::CycleRecord to_record(const telemetry_t& m) noexcept {
  rig::CycleRecord r;
  r.sequence = std::bit_cast<std::uint64_t>(m.cycle);
  r.stamp_ns = m.stamp_ns;
  r.time_s = m.time_s;
  r.phase = m.phase >= 0 && m.phase <= telemetry_t::PHASE_FAULT ? static_cast<rig::Phase>(m.phase) : rig::Phase::fault;
  r.reason = static_cast<rig::Reason>(m.reason);
  r.reason_value = m.reason_value;

  r.truth = {.speeds = {m.omega1_rad_s, m.omega2_rad_s},
             .slip = m.slip,
             .brake_torque_Nm = m.brake_torque_Nm,
             .theta_N = m.theta_N};
  r.control = {.speeds_est = {m.omega1_est_rad_s, m.omega2_est_rad_s},
               .slip_est = m.slip_est,
               .slip_ref = m.slip_ref,
               .slip_velocity_error_m_s = m.slip_velocity_error_m_s,
               .brake_torque_ref_Nm = m.brake_torque_ref_Nm,
               .brake_torque_est_Nm = m.brake_torque_est_Nm,
               .theta_est_N = m.theta_est_N};
  r.command = {.motor_duty = m.motor_pwm, .brake_duty = m.brake_pwm, .motor_enable = m.motor_enable != 0};

  r.measurement.time_ns = m.stamp_ns;
  r.measurement.upper_counts = m.upper_counts;
  r.measurement.lower_counts = m.lower_counts;
  r.measurement.supply_V = m.supply_V;
  r.measurement.temperature_C = m.temperature_C;
  r.measurement.trip_flags = static_cast<std::uint32_t>(m.trip_flags);

  r.timing.wakeup_latency_ns = m.wakeup_latency_ns;
  r.timing.read_ns = m.read_ns;
  r.timing.control_ns = m.control_ns;
  r.timing.write_ns = m.write_ns;
  r.timing.cycle_ns = m.cycle_ns;
  r.timing.record_ns = m.record_ns;
  r.timing.periods_skipped = static_cast<std::uint32_t>(m.periods_skipped);
  r.timing.overrun_cause = static_cast<rig::OverrunCause>(m.overrun_cause);
  return r;
}

measurement_t measured_at(const rig::CycleRecord& record) noexcept {
  measurement_t m{};
  m.cycle = std::bit_cast<std::int64_t>(record.sequence);
  m.measured_ns = record.measurement.time_ns;
  return m;
}

DecodedCommand decode_command(std::span<const std::uint8_t> packet) {
  DecodedCommand decoded;
  decoded.problem = decode_checked(packet, decoded.command);
  return decoded;
}

std::string printable(std::string_view text, std::size_t max_bytes) {
  std::string clean(text.substr(0, max_bytes));
  for (char& c : clean) {
    if (c < 0x20 || c > 0x7e) c = '?';
  }
  if (text.size() > max_bytes) clean += "...";
  return clean;
}

}  // namespace abs_hil::telemetry
