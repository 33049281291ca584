#include "telemetry/event_text.hpp"

#include <algorithm>
#include <cstdio>
#include <optional>
#include <utility>

#include "abs_hil/rig/phase.hpp"
#include "abs_hil/rig/quantities.hpp"
#include "telemetry/checked_decode.hpp"
#include "telemetry/csv_text.hpp"
#include "telemetry/hexadecimal.hpp"
#include "telemetry/message_codec.hpp"

namespace abs_hil::telemetry {
namespace {

using Bytes = std::vector<std::uint8_t>;

Fields split_header(std::string_view header) {
  Fields names;
  while (!header.empty()) {
    const std::size_t comma = std::min(header.find(','), header.size());
    names.emplace_back(header.substr(0, comma));
    header.remove_prefix(std::min(comma + 1, header.size()));
  }
  return names;
}

/// Columns of --csv. In a file of telemetry they come first, in the order of --csv. Other types do not have them.
template <class Message>
const Fields& first_columns() {
  static const Fields columns = [] {
    Fields names;
    if constexpr (std::same_as<Message, telemetry_t>) names.assign(rig::csv_columns.begin(), rig::csv_columns.end());
    return names;
  }();
  return columns;
}

template <class Message>
bool goes_first(std::string_view name) {
  return std::ranges::find(first_columns<Message>(), name) != first_columns<Message>().end();
}

template <class Message>
std::string header_of() {
  std::string header;
  const auto put = [&header](std::string_view name) { header.append(header.empty() ? "" : ",").append(name); };
  for (const std::string& name : first_columns<Message>()) put(name);
  Message message{};
  visit_fields(message, [&put](std::string_view name, const auto&) {
    if (!goes_first<Message>(name)) put(name);
  });
  return header.append(",").append(event_columns);
}

void put_event_columns(CsvRow& row, const LogEvent& event, std::string_view type) {
  row("", event.number);
  row("", event.timestamp_us);
  row("", event.channel);
  row.text(type);
}

/// The texts of `elsewhere` by their columns' names.
std::map<std::string_view, std::string> texts_of(const CellsFromElsewhere& elsewhere) {
  rig::CycleRecord record;
  record.sample_valid = elsewhere.sample_valid;
  record.wheels_apart = elsewhere.wheels_apart;
  record.sample_time_s = elsewhere.sample_time_s;
  const double distance_m = 0.0;
  const std::int64_t sequence = 0;
  const rig::CycleParts<const rig::CycleRecord> parts{record, distance_m, sequence};
  std::map<std::string_view, std::string> texts;
  rig::for_each_quantity([&](const auto& quantity) {
    if (quantity.in_lcm()) return;
    CsvRow one;
    if constexpr (std::is_arithmetic_v<std::remove_cvref_t<decltype(quantity.at(parts))>>) one({}, quantity.at(parts));
    texts[quantity.name] = one.row();
  });
  return texts;
}

template <class Message>
std::string row_of(const Message& message, const LogEvent& event, const CellsFromElsewhere& elsewhere) {
  CsvRow row;
  if constexpr (std::same_as<Message, telemetry_t>) {
    std::map<std::string_view, std::string> texts = texts_of(elsewhere);
    visit_fields(message, [&texts](std::string_view name, const auto& value) {
      CsvRow one;
      one(name, value);
      texts[name] = one.row();
    });
    texts["phase"] = rig::name_of(static_cast<rig::Phase>(message.phase));
    for (const std::string& column : first_columns<Message>()) row.text(texts[column]);
  }
  visit_fields(message, [&row](std::string_view name, const auto& value) {
    if (!goes_first<Message>(name)) row(name, value);
  });
  put_event_columns(row, event, type_name<Message>);
  return row.row();
}

/// Sets a message's fields from the texts of a row.
class FieldTexts {
 public:
  FieldTexts(const Columns& columns, const Fields& fields) : columns_(columns), fields_(fields) {}

  template <class Number>
    requires std::is_arithmetic_v<Number>
  void operator()(std::string_view name, Number& value) {
    const std::string* text = find(name);
    if (text == nullptr) return;
    if (name == "phase") {
      for (int phase = 0; phase <= telemetry_t::PHASE_FAULT; ++phase) {
        if (*text != rig::name_of(static_cast<rig::Phase>(phase))) continue;
        value = static_cast<Number>(phase);
        return;
      }
    }
    if (!parse_number(*text, value))
      problem_ = std::string(name) + ": '" + *text + "' is not a number of the field's type";
  }
  void operator()(std::string_view name, std::string& value) {
    if (const std::string* text = find(name)) value = *text;
  }
  [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

 private:
  const std::string* find(std::string_view name) {
    const auto column = columns_.find(name);
    if (column != columns_.end()) return &fields_[column->second];
    problem_ = "the column " + std::string(name) + " is missing";
    return nullptr;
  }
  const Columns& columns_;
  const Fields& fields_;
  std::string problem_;
};

template <class Message>
Bytes encoded(const Message& message) {
  EncodeBuffer buffer;
  const auto bytes = buffer.encode(message);
  return {bytes.begin(), bytes.end()};
}

/// True if the row gives the event's bytes again.
template <class Message>
bool comes_back(const EventText& text, const LogEvent& event) {
  std::FILE* memory = ::fmemopen(const_cast<char*>(text.row.data()), text.row.size(), "r");
  if (memory == nullptr) return false;
  const detail::FilePointer owner(memory);
  static const Columns columns = columns_of(split_header(header_of<Message>()));
  Fields fields;
  if (!CsvRows(memory).next(fields) || fields.size() != columns.size()) return false;
  Message message{};
  FieldTexts texts(columns, fields);
  visit_fields(message, texts);
  return texts.problem().empty() && encoded(message) == event.data;
}

}  // namespace

Columns columns_of(const Fields& header) {
  Columns columns;
  for (std::size_t i = 0; i < header.size(); ++i) columns[header[i]] = i;
  return columns;
}

std::string telemetry_header() { return header_of<telemetry_t>(); }

EventText text_of(const LogEvent& event, const CellsFromElsewhere& elsewhere) {
  EventText text;
  const std::int64_t fingerprint = fingerprint_of(event.data);
  for_each_message_type([&]<class Message>() {
    if (!text.row.empty() || fingerprint != static_cast<std::int64_t>(Message::getHash())) return;
    Message message{};
    if (!decode_checked(event.data, message).empty()) return;
    EventText made{std::string(type_name<Message>), header_of<Message>(), row_of(message, event, elsewhere)};
    if (comes_back<Message>(made, event)) text = std::move(made);
  });
  if (!text.row.empty()) return text;
  CsvRow row;
  row.text(hexadecimal(event.data));
  put_event_columns(row, event, raw_type);
  return {std::string(raw_type), std::string("data_hex,").append(event_columns), row.row()};
}

Bytes event_bytes(const Columns& columns, const Fields& fields) {
  const std::string& type = fields[columns.at("type")];
  if (type == raw_type && columns.contains("data_hex")) {
    if (auto bytes = bytes_of_hexadecimal(fields[columns.at("data_hex")])) return std::move(*bytes);
    throw std::invalid_argument("data_hex is not a text of hexadecimal digits");
  }
  std::optional<Bytes> data;
  for_each_message_type([&]<class Message>() {
    if (type != type_name<Message>) return;
    Message message{};
    FieldTexts texts(columns, fields);
    visit_fields(message, texts);
    if (!texts.problem().empty()) throw std::invalid_argument(texts.problem());
    data = encoded(message);
  });
  if (!data) throw std::invalid_argument("type '" + type + "' is unknown");
  return std::move(*data);
}

}  // namespace abs_hil::telemetry
