#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>

#include "abs_hil/rig/cycle_record.hpp"

namespace abs_hil::rig {

/// A cycle for a file or a message: its record and the values beside it. `Record` is CycleRecord, or const CycleRecord
/// for reading only.
template <class Record>
struct CycleParts {
  template <class T>
  using Part = std::conditional_t<std::is_const_v<Record>, const T, T>;
  Record& record;
  Part<double>& distance_m;      ///< distance of the car since the start of braking, m
  Part<std::int64_t>& sequence;  ///< of the message on its channel
};

/// Where a quantity goes: into telemetry (LCM and event log) only, or into the columns of a run, too (CSV, MCAP,
/// Parquet, Python).
enum class Destination : std::uint8_t { telemetry, both };

/// The topic of a quantity. A timing belongs to one run: a replay cannot reproduce it.
enum class Topic : std::uint8_t { sequence, motion, board, timing };

/// A row of the table. `Access` takes CycleParts and returns a reference to the value, to read and to write it.
template <class Access>
struct Quantity {
  std::string_view name;   ///< of the column and in telemetry_t, with its unit
  std::string_view unit;   ///< empty if it has none
  std::string_view since;  ///< first version of the program that writes it, into the CSV if it is a column
  Topic topic;
  Destination destination;
  Access at;
  std::string_view meaning;

  [[nodiscard]] constexpr bool in_csv() const noexcept { return destination == Destination::both; }
};

template <class Access>
Quantity(std::string_view, std::string_view, std::string_view, Topic, Destination, Access, std::string_view)
    -> Quantity<Access>;

/// Every run's CSV has the columns of this version.
inline constexpr std::string_view first_version = "0.1";

// clang-format off
/// The place of a value within CycleParts.
#define ABS_HIL_AT(place) [](auto& c) -> auto& { return c.place; }
/// Every quantity of a cycle, in the order of the CSV columns. Append new rows. A row needs no field in telemetry_t:
/// without one its value travels in telemetry_t's `values`, by its name.
inline constexpr std::tuple quantities{
    Quantity{"stamp_ns", "ns", "0.1", Topic::sequence, Destination::telemetry, ABS_HIL_AT(record.stamp_ns),
             "monotonic clock at the wake-up; virtual time with --fast"},
    Quantity{"sequence", "", "0.1", Topic::sequence, Destination::telemetry, ABS_HIL_AT(sequence),
             "messages of this channel from 0; a gap is a message lost on the way"},
    Quantity{"cycle", "", "0.1", Topic::sequence, Destination::telemetry, ABS_HIL_AT(record.sequence),
             "control cycles from 0; a gap without one in sequence is decimation or a dropped record"},
    Quantity{"time_s", "s", "0.1", Topic::sequence, Destination::both, ABS_HIL_AT(record.time_s),
             "time since the start of the run"},
    Quantity{"phase", "", "0.1", Topic::sequence, Destination::both, ABS_HIL_AT(record.phase),
             "phase of the experiment: its name in CSV, its number in LCM"},
    Quantity{"reason", "", "0.1", Topic::sequence, Destination::telemetry, ABS_HIL_AT(record.reason),
             "why this phase was entered or the command refused; 0: nothing happened"},
    Quantity{"reason_value", "", "0.1", Topic::sequence, Destination::telemetry, ABS_HIL_AT(record.reason_value),
             "the value that led to it, in the SI unit of its quantity; 0: none"},

    Quantity{"omega1_rad_s", "rad/s", "0.1", Topic::motion, Destination::both,
             ABS_HIL_AT(record.truth.speeds.omega1_rad_s), "true speed of the upper wheel; only a simulator knows it"},
    Quantity{"omega2_rad_s", "rad/s", "0.1", Topic::motion, Destination::both,
             ABS_HIL_AT(record.truth.speeds.omega2_rad_s), "true speed of the lower wheel; only a simulator knows it"},
    Quantity{"omega1_est_rad_s", "rad/s", "0.1", Topic::motion, Destination::both,
             ABS_HIL_AT(record.control.speeds_est.omega1_rad_s), "estimated speed of the upper wheel"},
    Quantity{"omega2_est_rad_s", "rad/s", "0.1", Topic::motion, Destination::both,
             ABS_HIL_AT(record.control.speeds_est.omega2_rad_s), "estimated speed of the lower wheel"},
    Quantity{"slip", "", "0.1", Topic::motion, Destination::both, ABS_HIL_AT(record.truth.slip),
             "true slip: 0 rolling, 1 locked, negative driven; only a simulator knows it"},
    Quantity{"slip_est", "", "0.1", Topic::motion, Destination::both, ABS_HIL_AT(record.control.slip_est),
             "slip from the estimated speeds"},
    Quantity{"slip_ref", "", "0.1", Topic::motion, Destination::both, ABS_HIL_AT(record.control.slip_ref),
             "slip asked for"},
    Quantity{"brake_torque_Nm", "N m", "0.1", Topic::motion, Destination::both,
             ABS_HIL_AT(record.truth.brake_torque_Nm),
             "true brake torque on the upper wheel; only a simulator knows it"},
    Quantity{"brake_torque_ref_Nm", "N m", "0.1", Topic::motion, Destination::both,
             ABS_HIL_AT(record.control.brake_torque_ref_Nm),
             "brake torque asked for, after limiting, on the PWM's steps"},
    Quantity{"brake_torque_est_Nm", "N m", "0.1", Topic::motion, Destination::both,
             ABS_HIL_AT(record.control.brake_torque_est_Nm), "brake torque estimated to act, through (6)-(7)"},
    Quantity{"brake_pwm", "", "0.1", Topic::motion, Destination::both, ABS_HIL_AT(record.command.brake_duty),
             "brake duty as the driver sent it, in [0, 1]"},
    Quantity{"motor_pwm", "", "0.1", Topic::motion, Destination::both, ABS_HIL_AT(record.command.motor_duty),
             "drive duty as the driver sent it, in [0, 1]"},
    Quantity{"motor_enable", "", "0.1", Topic::motion, Destination::both, ABS_HIL_AT(record.command.motor_enable),
             "1: the drive may act; 0: it is forced to 0"},
    Quantity{"theta_N", "N", "0.1", Topic::motion, Destination::both, ABS_HIL_AT(record.truth.theta_N),
             "true peak tyre force of (10); only a simulator knows it"},
    Quantity{"theta_est_N", "N", "0.1", Topic::motion, Destination::both, ABS_HIL_AT(record.control.theta_est_N),
             "estimated peak tyre force; NaN outside of braking"},
    Quantity{"distance_m", "m", "0.1", Topic::motion, Destination::both, ABS_HIL_AT(distance_m),
             "the car's way since the start of braking; 0 before"},
    Quantity{"slip_velocity_error_m_s", "m/s", "0.1", Topic::motion, Destination::both,
             ABS_HIL_AT(record.control.slip_velocity_error_m_s), "slip velocity error e_v of (13), from the estimates"},

    Quantity{"upper_counts", "counts", "0.2", Topic::board, Destination::both,
             ABS_HIL_AT(record.measurement.upper_counts),
             "encoder counter of the upper wheel as read; wraps around at 32 bit"},
    Quantity{"lower_counts", "counts", "0.2", Topic::board, Destination::both,
             ABS_HIL_AT(record.measurement.lower_counts),
             "encoder counter of the lower wheel as read; wraps around at 32 bit"},
    Quantity{"supply_V", "V", "0.1", Topic::board, Destination::telemetry, ABS_HIL_AT(record.measurement.supply_V),
             "power supply; NaN where the board does not measure it"},
    Quantity{"temperature_C", "degrees Celsius", "0.1", Topic::board, Destination::telemetry,
             ABS_HIL_AT(record.measurement.temperature_C), "power stage; NaN where the board does not measure it"},
    Quantity{"trip_flags", "", "0.1", Topic::board, Destination::telemetry, ABS_HIL_AT(record.measurement.trip_flags),
             "bits of the board's own interlocks; 0: none tripped"},

    Quantity{"wakeup_latency_ns", "ns", "0.1", Topic::timing, Destination::telemetry,
             ABS_HIL_AT(record.timing.wakeup_latency_ns), "lateness of the wake-up against its tick"},
    Quantity{"read_ns", "ns", "0.1", Topic::timing, Destination::telemetry, ABS_HIL_AT(record.timing.read_ns),
             "duration of reading the board"},
    Quantity{"control_ns", "ns", "0.1", Topic::timing, Destination::telemetry, ABS_HIL_AT(record.timing.control_ns),
             "duration of estimate, sequence, control and gate"},
    Quantity{"write_ns", "ns", "0.1", Topic::timing, Destination::telemetry, ABS_HIL_AT(record.timing.write_ns),
             "duration of writing to the board"},
    Quantity{"cycle_ns", "ns", "0.1", Topic::timing, Destination::telemetry, ABS_HIL_AT(record.timing.cycle_ns),
             "wake-up to end of write"},
    Quantity{"periods_skipped", "", "0.1", Topic::timing, Destination::telemetry,
             ABS_HIL_AT(record.timing.periods_skipped), "ticks missed before this one"},
    Quantity{"record_ns", "ns", "0.1", Topic::timing, Destination::telemetry, ABS_HIL_AT(record.timing.record_ns),
             "recording of the cycle before"},
    Quantity{"overrun_cause", "", "0.1", Topic::timing, Destination::telemetry, ABS_HIL_AT(record.timing.overrun_cause),
             "why ticks were missed: 0 none, 1 wake-up, 2 read, 3 control, 4 write, 5 record"},

    Quantity{"sample_valid", "", "0.2", Topic::board, Destination::both, ABS_HIL_AT(record.sample_valid),
             "1: the counts are of this cycle; 0: they are the latest usable ones"},
    Quantity{"sample_time_s", "s", "0.2", Topic::board, Destination::both, ABS_HIL_AT(record.sample_time_s),
             "when the counters were read, since the start of the run"},
    Quantity{"wheels_apart", "", "0.2", Topic::sequence, Destination::both, ABS_HIL_AT(record.wheels_apart),
             "1: the experiment says that the upper wheel is lifted off the lower one"},
    Quantity{"measured_ns", "ns", "0.2", Topic::board, Destination::telemetry, ABS_HIL_AT(record.measurement.time_ns),
             "monotonic clock at which the counters were read"},
    Quantity{"phase_index", "", "0.2", Topic::sequence, Destination::telemetry, ABS_HIL_AT(record.phase_index),
             "phases of the experiment from 0; an early end keeps the last number"},
    Quantity{"upper_edge_age_ns", "ns", "0.2", Topic::board, Destination::telemetry,
             ABS_HIL_AT(record.measurement.upper_edge_age_ns),
             "time since the upper wheel's last count, by the board's time stamp; -1: not known"},
    Quantity{"lower_edge_age_ns", "ns", "0.2", Topic::board, Destination::telemetry,
             ABS_HIL_AT(record.measurement.lower_edge_age_ns),
             "time since the lower wheel's last count, by the board's time stamp; -1: not known"},
};
#undef ABS_HIL_AT
// clang-format on

inline constexpr std::size_t quantity_count = std::tuple_size_v<decltype(quantities)>;

/// Calls `use(row)` for every row, in order.
template <class Use>
constexpr void for_each_quantity(Use&& use) {
  std::apply([&use](const auto&... row) { (use(row), ...); }, quantities);
}

/// Type of the value of a row.
template <class Row>
using ValueOf = std::remove_cvref_t<decltype(std::declval<const Row&>().at(std::declval<CycleParts<CycleRecord>&>()))>;

/// Topic of the quantity of that name; `sequence` if there is none.
[[nodiscard]] constexpr Topic topic_of(std::string_view name) noexcept {
  Topic topic = Topic::sequence;
  for_each_quantity([&](const auto& row) {
    if (row.name == name) topic = row.topic;
  });
  return topic;
}

/// True if a row has this name.
[[nodiscard]] constexpr bool is_quantity(std::string_view name) noexcept {
  bool found = false;
  for_each_quantity([&](const auto& row) { found = found || row.name == name; });
  return found;
}

/// Columns of a run's CSV, in order.
inline constexpr auto csv_columns = [] {
  constexpr std::size_t count =
      std::apply([](const auto&... row) { return (std::size_t{0} + ... + std::size_t{row.in_csv()}); }, quantities);
  std::array<std::string_view, count> names{};
  std::size_t n = 0;
  for_each_quantity([&](const auto& row) {
    if (row.in_csv()) names[n++] = row.name;
  });
  return names;
}();

}  // namespace abs_hil::rig
