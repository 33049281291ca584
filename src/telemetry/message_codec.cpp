#include "telemetry/message_codec.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <limits>
#include <tuple>
#include <type_traits>
#include <utility>

#include "abs_hil/message_fields.hpp"
#include "abs_hil/rig/quantities.hpp"
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

/// A name as a template argument, so that the compiler's message shows it.
template <std::size_t size>
struct Name {
  constexpr explicit Name(std::string_view name) { std::copy(name.begin(), name.end(), text); }
  char text[size]{};
};

constexpr std::size_t field_count = std::tuple_size_v<std::remove_const_t<decltype(fields<telemetry_t>)>>;

/// Index of the field of that name in telemetry_t; field_count if there is none.
constexpr std::size_t field_of(std::string_view name) {
  return std::apply(
      [name](const auto&... field) {
        std::size_t n = 0;
        static_cast<void>(((field.name == name || (++n, false)) || ...));
        return n;
      },
      fields<telemetry_t>);
}

template <Name name, bool is_there>
constexpr bool row_has_field() {
  static_assert(is_there, "this row of rig/quantities.hpp goes to LCM, but telemetry_t.lcm has no field of its name");
  return is_there;
}
template <Name name, bool is_there>
constexpr bool field_has_row() {
  static_assert(is_there, "this field of telemetry_t.lcm has no row for LCM in rig/quantities.hpp");
  return is_there;
}

constexpr bool goes_to_lcm(std::string_view name) {
  bool found = false;
  rig::for_each_quantity([&](const auto& row) { found = found || (row.in_lcm() && row.name == name); });
  return found;
}

template <std::size_t... n>
constexpr bool every_field_has_row(std::index_sequence<n...>) {
  constexpr auto& all = fields<telemetry_t>;
  return (field_has_row<Name<std::get<n>(all).name.size() + 1>(std::get<n>(all).name),
                        goes_to_lcm(std::get<n>(all).name)>() &&
          ...);
}
static_assert(every_field_has_row(std::make_index_sequence<field_count>{}));

template <std::size_t n, class Message, class Parts, class Use>
void use_match(Message& message, const Parts& parts, const Use& use) {
  constexpr auto& row = std::get<n>(rig::quantities);
  if constexpr (row.in_lcm()) {
    constexpr std::size_t place = field_of(row.name);
    if constexpr (row_has_field<Name<row.name.size() + 1>(row.name), (place < field_count)>()) {
      use(message.*std::get<place>(fields<telemetry_t>).member, row.at(parts));
    }
  }
}

/// Calls `use(field, value)` with each field of the message and the value of the cycle that has its name.
template <class Message, class Parts, class Use>
void for_each_match(Message& message, const Parts& parts, const Use& use) {
  [&]<std::size_t... n>(std::index_sequence<n...>) {
    (use_match<n>(message, parts, use), ...);
  }(std::make_index_sequence<rig::quantity_count>{});
}

template <class Field, class Value>
void read(const Field& field, Value& value) {
  value = static_cast<Value>(field);
}
void read(const std::int8_t& field, bool& value) { value = field != 0; }
/// An unknown number counts as the phase fault.
void read(const std::int8_t& field, rig::Phase& value) {
  value = field >= 0 && field <= telemetry_t::PHASE_FAULT ? static_cast<rig::Phase>(field) : rig::Phase::fault;
}

}  // namespace

telemetry_t to_message(const rig::CycleRecord& record, double distance_m, std::int64_t sequence) noexcept {
  telemetry_t message{};
  for_each_match(message, rig::CycleParts<const rig::CycleRecord>{record, distance_m, sequence},
                 [](auto& field, const auto& value) { field = static_cast<std::decay_t<decltype(field)>>(value); });
  return message;
}

rig::CycleRecord to_record(const telemetry_t& message) noexcept {
  rig::CycleRecord record;
  double distance_m = 0.0;
  std::int64_t sequence = 0;
  for_each_match(message, rig::CycleParts<rig::CycleRecord>{record, distance_m, sequence},
                 [](const auto& field, auto& value) { read(field, value); });
  record.measurement.time_ns = message.stamp_ns;
  return record;
}

measurement_t measured_at(const rig::CycleRecord& record) noexcept {
  measurement_t m{};
  m.cycle = std::bit_cast<std::int64_t>(record.sequence);
  m.measured_ns = record.measurement.time_ns;
  return m;
}

namespace {
constexpr std::array signal_fields{&signals_t::value1, &signals_t::value2, &signals_t::value3, &signals_t::value4,
                                   &signals_t::value5, &signals_t::value6, &signals_t::value7, &signals_t::value8};
static_assert(signal_fields.size() == rig::signal_max, "signals_t.lcm has a field for every signal");
}  // namespace

void put_signals(const rig::CycleRecord& record, std::size_t count, signals_t& message) noexcept {
  message.cycle = std::bit_cast<std::int64_t>(record.sequence);
  for (std::size_t n = 0; n < rig::signal_max; ++n) {
    message.*signal_fields[n] = n < count ? record.control.signals[n] : rig::unknown;
  }
}

rig::SignalValues signals_of(const signals_t& message) noexcept {
  rig::SignalValues values{};
  for (std::size_t n = 0; n < rig::signal_max; ++n) values[n] = message.*signal_fields[n];
  return values;
}

DecodedCommand decode_command(std::span<const std::uint8_t> packet) {
  DecodedCommand decoded;
  decoded.problem = decode_checked(packet, decoded.command);
  return decoded;
}

}  // namespace abs_hil::telemetry
