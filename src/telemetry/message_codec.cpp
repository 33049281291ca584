// Packs a record into telemetry_t and reads it back by the names of its values.
#include "telemetry/message_codec.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>
#include <type_traits>
#include <utility>

#include "abs_hil/message_fields.hpp"
#include "abs_hil/rig/quantities.hpp"

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

/// The table's rows without a field of their own: their values travel in `values`, in this order.
template <std::size_t n>
constexpr bool has_field = field_of(std::get<n>(rig::quantities).name) < field_count;

/// Fields that no row fills: what `values` needs, and texts.
constexpr std::array fields_beside{std::string_view("phase_name"), std::string_view("names"),
                                   std::string_view("value_count"), std::string_view("values")};
constexpr std::size_t rows_with_field = []<std::size_t... n>(std::index_sequence<n...>) {
  return (std::size_t{0} + ... + std::size_t{has_field<n>});
}(std::make_index_sequence<rig::quantity_count>{});
static_assert(rows_with_field + fields_beside.size() == field_count,
              "a field of telemetry_t.lcm has no row in rig/quantities.hpp");

/// Calls `use(row, field)` for each row with a field in the message, and `other(row)` for each row without.
template <class Message, class Use, class Other>
void for_each_row(Message& message, const Use& use, const Other& other) {
  const auto one = [&]<std::size_t n>(std::integral_constant<std::size_t, n>) {
    constexpr auto& row = std::get<n>(rig::quantities);
    if constexpr (has_field<n>) {
      use(row, message.*std::get<field_of(row.name)>(fields<telemetry_t>).member);
    } else {
      other(row);
    }
  };
  [&]<std::size_t... n>(std::index_sequence<n...>) {
    (one(std::integral_constant<std::size_t, n>{}), ...);
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

/// False for NaN and for what an integer of this type cannot hold.
template <class Value>
bool fits(double value) noexcept {
  using Limits = std::numeric_limits<Value>;
  return value >= static_cast<double>(Limits::min()) && value < std::ldexp(1.0, Limits::digits);
}

}  // namespace

telemetry_t blank_message(const rig::RunNames& names) {
  telemetry_t message{};
  const auto add = [&message](std::string_view name) {
    message.names.append(message.names.empty() ? "" : ",").append(name);
    ++message.value_count;
  };
  for_each_row(
      message, [](const auto&, const auto&) {}, [&add](const auto& row) { add(row.name); });
  for (const std::string& signal : names.signals) add(signal);
  message.values.assign(static_cast<std::size_t>(message.value_count), rig::unknown);
  return message;
}

void put_record(const rig::CycleRecord& record, double distance_m, const rig::RunNames& names, telemetry_t& message) {
  const std::int64_t sequence = message.sequence;
  const rig::CycleParts<const rig::CycleRecord> parts{record, distance_m, sequence};
  auto value = message.values.begin();
  for_each_row(
      message,
      [&parts](const auto& row, auto& field) { field = static_cast<std::decay_t<decltype(field)>>(row.at(parts)); },
      [&](const auto& row) { *value++ = static_cast<double>(row.at(parts)); });
  for (std::size_t n = 0; value != message.values.end(); ++value, ++n) *value = record.control.signals.at(n);
  if (names.has_own_phase_names()) message.phase_name = names.phase_of(record);
}

telemetry_t to_message(const rig::CycleRecord& record, double distance_m, std::int64_t sequence,
                       const rig::RunNames& names) {
  telemetry_t message = blank_message(names);
  message.sequence = sequence;
  put_record(record, distance_m, names, message);
  return message;
}

rig::CycleRecord to_record(const telemetry_t& message) {
  rig::CycleRecord record;
  double distance_m = 0.0;
  std::int64_t sequence = 0;
  const rig::CycleParts<rig::CycleRecord> parts{record, distance_m, sequence};
  const std::vector<NamedValue> values = values_of(message);
  std::size_t signals = 0;
  for (const NamedValue& named : values) {
    if (!rig::is_quantity(named.name) && signals < rig::signal_max) record.control.signals[signals++] = named.value;
  }
  for_each_row(
      message, [&parts](const auto& row, const auto& field) { read(field, row.at(parts)); },
      [&](const auto& row) {
        using Value = std::decay_t<decltype(row.at(parts))>;
        const auto found = std::ranges::find(values, row.name, &NamedValue::name);
        const double value = found != values.end() ? found->value : rig::unknown;
        if constexpr (std::is_floating_point_v<Value>) {
          row.at(parts) = value;
        } else if (fits<Value>(value)) {  // otherwise the record's own default stays
          row.at(parts) = static_cast<Value>(value);
        }
      });
  return record;
}

std::vector<NamedValue> values_of(const telemetry_t& message) {
  std::vector<NamedValue> all;
  std::string_view names = message.names;
  for (std::size_t n = 0; n < message.values.size() && !names.empty(); ++n) {
    const std::size_t comma = std::min(names.find(','), names.size());
    all.push_back({names.substr(0, comma), message.values[n]});
    names.remove_prefix(std::min(comma + 1, names.size()));
  }
  return all;
}

std::vector<std::string> signals_of(const telemetry_t& message) {
  std::vector<std::string> names;
  for (const NamedValue& named : values_of(message)) {
    if (names.size() < rig::signal_max && rig::is_signal_name(named.name)) names.emplace_back(named.name);
  }
  return names;
}

std::vector<std::string_view> lacking_in(const telemetry_t& message) {
  std::vector<std::string_view> lacking;
  const std::vector<NamedValue> values = values_of(message);
  for_each_row(
      message, [](const auto&, const auto&) {},
      [&](const auto& row) {
        if (std::ranges::find(values, row.name, &NamedValue::name) == values.end()) lacking.push_back(row.name);
      });
  return lacking;
}

}  // namespace abs_hil::telemetry
