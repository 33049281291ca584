#include "abs_hil/telemetry/message_codec.hpp"

#include <bit>
#include <limits>

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

/// Reads LCM's big-endian numbers and checks strings, never beyond the end.
class PacketChecker {
 public:
  explicit PacketChecker(std::span<const std::uint8_t> packet) : rest_(packet) {}

  bool skip(std::size_t bytes) {
    if (rest_.size() < bytes) return false;
    rest_ = rest_.subspan(bytes);
    return true;
  }

  template <class Unsigned>
  bool read(Unsigned& value) {
    if (rest_.size() < sizeof value) return false;
    std::uint64_t bits = 0;
    for (std::size_t i = 0; i < sizeof value; ++i) bits = bits << 8U | rest_[i];
    value = static_cast<Unsigned>(bits);
    return skip(sizeof value);
  }

  /// A string is its length with the final NUL, then its bytes with the NUL.
  bool skip_string() {
    std::uint32_t length = 0;
    if (!read(length) || length == 0 || length > rest_.size()) return false;
    return rest_[length - 1] == 0 && skip(length);
  }

 private:
  std::span<const std::uint8_t> rest_;
};

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

DecodedCommand decode_command(std::span<const std::uint8_t> packet) {
  PacketChecker checker(packet);
  std::uint64_t fingerprint = 0;
  if (!checker.read(fingerprint)) return {{}, "shorter than a fingerprint"};
  if (fingerprint != std::bit_cast<std::uint64_t>(static_cast<std::int64_t>(command_t::getHash()))) {
    return {{}, "not an abs_hil.command_t (wrong fingerprint)"};
  }
  const bool sound =
      checker.skip(2 * sizeof(std::int64_t)) && checker.skip_string() && checker.skip_string() && checker.skip_string();
  if (!sound) return {{}, "truncated or damaged"};

  DecodedCommand decoded;
  if (decoded.command.decode(packet.data(), 0, static_cast<int>(packet.size())) < 0) {
    decoded.problem = "truncated or damaged";
  }
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
