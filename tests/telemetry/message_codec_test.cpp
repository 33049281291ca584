// From a record to a message and back, also in older logs.
#include "telemetry/message_codec.hpp"

#include <bit>
#include <cmath>
#include <limits>
#include <string>

#include "abs_hil/command_t.hpp"
#include "catch.hpp"
#include "telemetry/message_capture.hpp"
#include "telemetry/sample_records.hpp"

namespace abs_hil::telemetry {
namespace {

telemetry_t through_bytes(const telemetry_t& message) {
  EncodeBuffer buffer(1);  // has to grow
  const auto bytes = buffer.encode(message);
  return test::decoded<telemetry_t>({bytes.begin(), bytes.end()});
}

void check_same(double actual, double expected) {
  CHECK(std::bit_cast<std::uint64_t>(actual) == std::bit_cast<std::uint64_t>(expected));
}

void check_fields(const rig::CycleRecord& r, double distance_m) {
  const telemetry_t m = through_bytes(to_message(r, distance_m, 99));
  CHECK(m.stamp_ns == r.stamp_ns);
  CHECK(m.sequence == 99);
  CHECK(m.cycle == static_cast<std::int64_t>(r.sequence));
  check_same(m.time_s, r.time_s);
  CHECK(m.phase == static_cast<int>(r.phase));
  CHECK(m.reason == static_cast<int>(r.reason));
  check_same(m.reason_value, r.reason_value);
  check_same(m.omega1_rad_s, r.truth.speeds.omega1_rad_s);
  check_same(m.omega2_rad_s, r.truth.speeds.omega2_rad_s);
  check_same(m.omega1_est_rad_s, r.control.speeds_est.omega1_rad_s);
  check_same(m.omega2_est_rad_s, r.control.speeds_est.omega2_rad_s);
  check_same(m.slip, r.truth.slip);
  check_same(m.slip_est, r.control.slip_est);
  check_same(m.slip_ref, r.control.slip_ref);
  check_same(m.brake_torque_Nm, r.truth.brake_torque_Nm);
  check_same(m.brake_torque_ref_Nm, r.control.brake_torque_ref_Nm);
  check_same(m.brake_torque_est_Nm, r.control.brake_torque_est_Nm);
  check_same(m.brake_pwm, r.command.brake_duty);
  check_same(m.motor_pwm, r.command.motor_duty);
  CHECK((m.motor_enable != 0) == r.command.motor_enable);
  check_same(m.theta_N, r.truth.theta_N);
  check_same(m.theta_est_N, r.control.theta_est_N);
  check_same(m.distance_m, distance_m);
  check_same(m.slip_velocity_error_m_s, r.control.slip_velocity_error_m_s);
  CHECK(m.upper_counts == r.measurement.upper_counts);
  CHECK(m.lower_counts == r.measurement.lower_counts);
  check_same(m.supply_V, r.measurement.supply_V);
  check_same(m.temperature_C, r.measurement.temperature_C);
  CHECK(m.trip_flags == static_cast<std::int64_t>(r.measurement.trip_flags));
  CHECK(m.wakeup_latency_ns == r.timing.wakeup_latency_ns);
  CHECK(m.read_ns == r.timing.read_ns);
  CHECK(m.control_ns == r.timing.control_ns);
  CHECK(m.write_ns == r.timing.write_ns);
  CHECK(m.cycle_ns == r.timing.cycle_ns);
  CHECK(m.periods_skipped == static_cast<std::int64_t>(r.timing.periods_skipped));
  CHECK(m.record_ns == r.timing.record_ns);
  CHECK(m.overrun_cause == static_cast<int>(r.timing.overrun_cause));
  CHECK((m.sample_valid != 0) == r.sample_valid);
  check_same(m.sample_time_s, r.sample_time_s);
  CHECK(m.measured_ns == r.measurement.time_ns);
  CHECK((m.wheels_apart != 0) == r.wheels_apart);
  CHECK(m.phase_index == r.phase_index);
}

TEST_CASE("every field of a record arrives") {
  rig::CycleRecord r = test::sample_record(12345);
  r.reason = rig::Reason::overspeed;
  r.reason_value = 181.5;
  check_fields(r, 0.125);
}

TEST_CASE("signals come by their names, and a phase by its own; a record without names has none") {
  rig::CycleRecord r = test::sample_record(7);
  r.phase_index = 1;
  r.control.signals = {0.5, rig::unknown, 7.0};
  const rig::RunNames names{.phases = {{rig::Phase::brake, "brake"}, {rig::Phase::brake, "brake-high"}},
                            .signals = {"I_m", "zeta_N"}};
  const telemetry_t m = through_bytes(to_message(r, 1.0, 3, names));
  CHECK(m.phase_name == "brake-high");
  CHECK(m.names == "upper_edge_age_ns,lower_edge_age_ns,I_m,zeta_N");
  REQUIRE(m.values.size() == 4);  // there is no third signal
  CHECK(m.values[2] == 0.5);
  CHECK(std::isnan(m.values[3]));
  CHECK(signals_of(m) == names.signals);
  CHECK(to_record(m).control.signals[0] == 0.5);
  CHECK(std::isnan(to_record(m).control.signals[2]));
  CHECK(lacking_in(m).empty());
  CHECK(to_message(r, 1.0, 3).phase_name.empty());
  CHECK(to_message(r, 1.0, 3).names == "upper_edge_age_ns,lower_edge_age_ns");
}

TEST_CASE("a quantity that an older log lacks, or that its type cannot hold, keeps the record's default") {
  rig::CycleRecord r = test::sample_record(7);
  r.measurement.upper_edge_age_ns = 250;
  r.measurement.lower_edge_age_ns = 0;
  telemetry_t m = to_message(r, 1.0, 3);
  CHECK(to_record(m).measurement.upper_edge_age_ns == 250);
  CHECK(to_record(m).measurement.lower_edge_age_ns == 0);
  for (const double strange : {rig::unknown, 1e300, -1e300, 2147483648.0}) {
    m.values[0] = strange;
    CHECK(to_record(m).measurement.upper_edge_age_ns == rig::no_edge_age);
  }
  m.names.clear();
  CHECK(to_record(m).measurement.lower_edge_age_ns == rig::no_edge_age);
  CHECK(lacking_in(m) == std::vector<std::string_view>{"upper_edge_age_ns", "lower_edge_age_ns"});
}

TEST_CASE("a message with more values than names, and names that no value has, is read as far as both go") {
  telemetry_t m = to_message(test::sample_record(7), 1.0, 3, {.signals = {"I_m", "zeta_N"}});
  m.names = "I_m";
  CHECK(values_of(m).size() == 1);
  m.names = ",,a,b,c,d,e,f,g,h,i,j";
  CHECK(values_of(m).size() == 4);
  m.values.assign(20, 1.0);
  m.value_count = 20;
  CHECK(values_of(m).size() == 12);
  CHECK(signals_of(m).size() == rig::signal_max);
  CHECK(to_record(m).control.signals[7] == 1.0);
}

TEST_CASE("the default record arrives, NaN and all") { check_fields({}, 0.0); }

TEST_CASE("extreme values arrive") {
  using Double = std::numeric_limits<double>;
  using Int = std::numeric_limits<std::int64_t>;
  rig::CycleRecord r = test::sample_record(1);
  r.sequence = static_cast<std::uint64_t>(Int::max());
  r.stamp_ns = Int::min();
  r.time_s = Double::max();
  r.phase = rig::Phase::fault;
  r.reason = rig::Reason::consecutive_overruns;
  r.reason_value = -Double::infinity();
  r.truth.speeds = {-0.0, Double::denorm_min()};
  r.control.theta_est_N = Double::infinity();
  r.measurement.upper_counts = std::numeric_limits<std::int32_t>::min();
  r.measurement.lower_counts = std::numeric_limits<std::int32_t>::max();
  r.measurement.trip_flags = 0xFFFFFFFFU;
  r.timing = {Int::min(), Int::max(), -1, 0, Int::max(), 0xFFFFFFFFU};
  check_fields(r, -Double::max());
}

command_t stop_command() {
  command_t command{};
  command.stamp_ns = 1;
  command.sequence = 2;
  command.command = "stop";
  command.name = "now";
  command.sender = "abc";
  return command;
}

struct DecodedCommand {
  command_t command{};
  std::string_view problem{};
};
DecodedCommand decoded_command(std::span<const std::uint8_t> packet) {
  DecodedCommand decoded;
  decoded.problem = decode_checked(packet, decoded.command);
  return decoded;
}

test::Bytes bytes_of(const command_t& command) {
  EncodeBuffer buffer;
  const auto bytes = buffer.encode(command);
  return {bytes.begin(), bytes.end()};
}

TEST_CASE("a well-formed command is decoded") {
  const auto [command, problem] = decoded_command(bytes_of(stop_command()));
  CHECK(problem.empty());
  CHECK(command.command == "stop");
  CHECK(command.name == "now");
  CHECK(command.sender == "abc");
}

TEST_CASE("a command cut short anywhere is refused") {
  const test::Bytes whole = bytes_of(stop_command());
  for (std::size_t size = 0; size < whole.size(); ++size) {
    INFO("cut to " << size);
    CHECK_FALSE(decoded_command(std::span(whole).first(size)).problem.empty());
  }
}

TEST_CASE("string lengths that lie are refused, those included that the generated decoder trips over") {
  const std::size_t first_length_at = 8 + 8 + 8;
  for (const std::uint32_t lie : {0U, 0xFFFFFFFFU, 0x80000000U, 0x7FFFFFFFU, 4U, 6U, 1000U}) {
    test::Bytes packet = bytes_of(stop_command());
    for (std::size_t i = 0; i < 4; ++i) {
      packet[first_length_at + i] = static_cast<std::uint8_t>(lie >> (24U - 8U * static_cast<unsigned>(i)));
    }
    INFO("length " << lie);
    CHECK_FALSE(decoded_command(packet).problem.empty());
  }
}

TEST_CASE("every single changed byte is either refused or gives strings within the packet") {
  const test::Bytes whole = bytes_of(stop_command());
  for (std::size_t at = 0; at < whole.size(); ++at) {
    for (const unsigned change : {0x01U, 0x80U, 0xFFU}) {
      test::Bytes packet = whole;
      packet[at] = static_cast<std::uint8_t>(packet[at] ^ change);
      const auto [command, problem] = decoded_command(packet);
      CHECK((!problem.empty() || command.command.size() < packet.size()));
      if (at < 8) CHECK_FALSE(problem.empty());
    }
  }
}

TEST_CASE("another type's message is refused by its fingerprint") {
  EncodeBuffer buffer;
  CHECK_THAT(std::string(decoded_command(buffer.encode(telemetry_t{})).problem),
             Catch::Matchers::Contains("fingerprint"));
}

TEST_CASE("a string with a NUL inside is encoded as far as it goes and decodes again") {
  command_t command = stop_command();
  command.sender = std::string("a\0b", 3);
  const auto result = decoded_command(bytes_of(command));
  CHECK(result.problem.empty());
  CHECK(result.command.sender == "a");
}

}  // namespace
}  // namespace abs_hil::telemetry
