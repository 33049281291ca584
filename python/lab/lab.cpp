// The simulation core for a web page (`abs_hil lab`): options as words of the command line in, a run's rows, events and
// figures of merit out, as JSON and as columns of doubles in the module's memory. Every answer stays until the next
// call; lab_size() is its size in bytes. A request that cannot be met is answered by {"error": why}.
#include <cstdint>
#include <cstdlib>
#include <deque>
#include <exception>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "abs_hil/control/registry.hpp"
#include "abs_hil/rig/quantities.hpp"
#include "abs_hil/rig/reason.hpp"
#include "analysis/braking_figures.hpp"
#include "config/config_file.hpp"
#include "config/key_table.hpp"
#include "config/merge.hpp"
#include "files.hpp"
#include "rig/gate_counts.hpp"
#include "rig/record_sink.hpp"
#include "run/run.hpp"
#include "telemetry/csv_sink.hpp"

namespace abs_hil::lab {

namespace {

using Json = nlohmann::ordered_json;

Json range_of(const config::Key& key) {
  if (std::holds_alternative<bool*>(key.target) || std::holds_alternative<std::string*>(key.target)) return nullptr;
  return {{"least", key.range.least},
          {"most", key.range.most},
          {"least_open", key.range.least_open},
          {"most_open", key.range.most_open},
          {"text", key.range.text()}};
}

template <class Kept>
constexpr const char* type_of = "text";
template <>
constexpr const char* type_of<double> = "number";
template <>
constexpr const char* type_of<std::int32_t> = "integer";
template <>
constexpr const char* type_of<std::int64_t> = "integer";
template <>
constexpr const char* type_of<bool> = "flag";

Json keys() {
  config::Settings settings;
  const config::KeyTable table(settings);
  Json rows = Json::array();
  for (const config::Key& key : table.keys()) {
    Json row{{"name", key.name}, {"unit", key.unit}, {"meaning", key.meaning}, {"range", range_of(key)}};
    std::visit(
        [&row](const auto* target) {
          row["type"] = type_of<std::remove_cvref_t<decltype(*target)>>;
          row["value"] = *target;
        },
        key.target);
    if (!key.allowed.empty()) row["allowed"] = key.allowed.list();
    if (key.search.given()) row["search"] = {key.search.least, key.search.most, key.search.logarithmic};
    rows.push_back(std::move(row));
  }
  return rows;
}

Json tables() {
  Json all{{"keys", keys()}};
  for (const control::ControllerEntry& entry : control::controllers()) {
    all["controllers"].push_back(
        {{"name", entry.name}, {"meaning", entry.summary}, {"section", control::section_of(entry.name)}});
  }
  for (const config::PlantEntry& plant : config::known_plants()) {
    all["plants"].push_back({{"name", plant.name}, {"meaning", plant.description}});
  }
  for (const auto& script : config::known_experiments()) {
    if (script->series.given) continue;
    all["experiments"].push_back({{"name", script->name}, {"meaning", script->description}, {"text", script->text}});
  }
  for (const analysis::Figure& figure : analysis::figures) {
    all["figures"].push_back({{"name", figure.name},
                              {"title", figure.title},
                              {"unit", figure.unit},
                              {"decimals", figure.decimals},
                              {"better", analysis::name_of(figure.better)},
                              {"compared", figure.compared},
                              {"meaning", figure.meaning}});
  }
  for (const rig::ReasonRow& row : rig::reasons) {
    all["reasons"][std::to_string(static_cast<int>(row.reason))] = {{"kind", rig::name_of(row.kind)},
                                                                    {"text", row.text}};
  }
  for (int phase = 0; phase <= static_cast<int>(rig::Phase::fault); ++phase) {
    all["phases"].push_back(rig::name_of(static_cast<rig::Phase>(phase)));
  }
  for (std::size_t action = 0; action < rig::gate_action_count; ++action) {
    all["gate_actions"].push_back(rig::name_of(static_cast<rig::GateAction>(action)));
  }
  return all;
}

/// What a page draws: all but the timings, which virtual time does not have.
template <class Row>
constexpr bool is_drawn(const Row& row) {
  return row.topic != rig::Topic::timing && row.name != "sequence" && row.name != "stamp_ns";
}

/// The rows of one run, as columns and as they came.
class Rows final : public rig::RecordSink {
 public:
  Rows() {
    rig::for_each_quantity([this](const auto& row) {
      if (is_drawn(row)) columns_.push_back({.name = std::string(row.name), .unit = std::string(row.unit)});
    });
    for (std::size_t n = 0; n < rig::signal_max; ++n) columns_.push_back({});
  }
  void consume(const rig::CycleRecord& record, double distance_m) override {
    constexpr std::int64_t no_message = 0;
    const rig::CycleParts<const rig::CycleRecord> parts{record, distance_m, no_message};
    auto column = columns_.begin();
    rig::for_each_quantity([&](const auto& row) {
      if (is_drawn(row)) (column++)->values.push_back(static_cast<double>(row.at(parts)));
    });
    for (std::size_t n = 0; n < rig::signal_max; ++n) (column++)->values.push_back(record.control.signals[n]);
    records_.emplace_back(record, distance_m);
  }
  /// After each cycle: what the gate has counted so far. Keeps the cycle's actions, a bit for each.
  void note_gate(const rig::GateCounts& counts) {
    std::uint16_t actions = 0;
    for (std::size_t n = 0; n < counts.size(); ++n) {
      if (counts[n] != counted_[n]) actions = static_cast<std::uint16_t>(actions | 1U << n);
    }
    gate_.push_back(actions);
    counted_ = counts;
  }
  [[nodiscard]] std::uintptr_t gate_address() const noexcept { return reinterpret_cast<std::uintptr_t>(gate_.data()); }
  [[nodiscard]] std::size_t size() const noexcept { return records_.size(); }
  [[nodiscard]] Json columns(const std::vector<std::string>& signals) {
    Json all = Json::array();
    const std::size_t own = columns_.size() - rig::signal_max;
    for (std::size_t n = 0; n < own + signals.size(); ++n) {
      if (n >= own) columns_[n].name = signals[n - own];
      all.push_back({{"name", columns_[n].name},
                     {"unit", columns_[n].unit},
                     {"own", n >= own},
                     {"address", reinterpret_cast<std::uintptr_t>(columns_[n].values.data())}});
    }
    return all;
  }
  [[nodiscard]] Json events(const rig::RunNames& names) const {
    Json all = Json::array();
    telemetry::EventDetector detector(names);
    for (const auto& [record, distance_m] : records_) {
      const auto event = detector.observe(record);
      if (event) all.push_back({{"time_s", record.time_s}, {"kind", event->kind}, {"message", event->message}});
    }
    return all;
  }
  [[nodiscard]] std::string csv(const rig::RunNames& names) const {
    std::string all(telemetry::csv_header);
    if (names.has_own_phase_names()) all.append(",").append(telemetry::phase_name_column);
    for (const std::string& signal : names.signals) all.append(",").append(signal);
    all += '\n';
    for (const auto& [record, distance_m] : records_) {
      char row[telemetry::csv_row_max_bytes];
      all.append(row, telemetry::format_csv_row(record, distance_m, row, names));
    }
    return all;
  }

 private:
  struct Column {
    std::string name{};
    std::string unit{};
    std::vector<double> values{};
  };
  std::vector<Column> columns_;
  std::vector<std::pair<rig::CycleRecord, double>> records_;
  std::vector<std::uint16_t> gate_;
  rig::GateCounts counted_{};
};

struct Answer {
  std::string text{};
  std::optional<Rows> rows{std::in_place};
  rig::RunNames names{};
};

Answer& answer() {
  static Answer one;
  return one;
}

/// @param words  as on the command line: ["--controller", "adaptive", "--set", "control.slip_ref=0.2"]
Json run(const std::vector<std::string>& words) {
  Answer& a = answer();
  a.rows.emplace();
  const config::Configuration request = config::merge(config::sources_of(words));
  run::require_simulated(request.settings, *request.script);
  const run::Prepared prepared(request.settings, *request.script);
  run::Run run(prepared);
  run.record_into({&*a.rows});
  run.begin();
  for (bool more = true; more;) {
    more = run.cycle();
    a.rows->note_gate(run.gate().counts());
  }
  const analysis::RunSummary summary = run::summarise(run, run.outcome());
  a.names = run.names();
  Json phases = Json::array();
  for (const rig::NamedPhase& phase : a.names.phases) {
    phases.push_back({{"kind", rig::name_of(phase.kind)}, {"name", phase.name}});
  }
  Json figures = Json::object();
  for (const analysis::Figure& figure : analysis::figures) {
    figures[std::string(figure.name)] = figure.of(summary.metrics);
  }
  return {{"rows", a.rows->size()},
          {"columns", a.rows->columns(a.names.signals)},
          {"gate", a.rows->gate_address()},
          {"phases", std::move(phases)},
          {"events", a.rows->events(a.names)},
          {"figures", std::move(figures)},
          {"summary", analysis::to_json(summary)},
          {"config", Json::parse(request.json)}};
}

template <class Work>
const char* answered(const Work& work) {
  try {
    answer().text = work();
  } catch (const std::exception& error) {
    answer().text = Json{{"error", error.what()}}.dump();
  }
  return answer().text.c_str();
}

}  // namespace

}  // namespace abs_hil::lab

using namespace abs_hil;

#define LAB_EXPORT(name) __attribute__((export_name(#name))) name
extern "C" {

/// Memory for a text of `size` bytes that the page passes.
char* LAB_EXPORT(lab_take)(std::size_t size) {
  static std::deque<std::string> texts(3);
  texts.pop_front();
  return texts.emplace_back(size, '\0').data();
}
std::size_t LAB_EXPORT(lab_size)() { return lab::answer().text.size(); }

/// The tables that the page is made from.
const char* LAB_EXPORT(lab_tables)() {
  return lab::answered([] { return lab::tables().dump(); });
}
/// From now on `name` is a file with this text.
void LAB_EXPORT(lab_give_file)(const char* name, std::size_t name_size, const char* text, std::size_t size) {
  lab::give_file({name, name_size}, {text, size});
}
/// One run of the words, a JSON array.
const char* LAB_EXPORT(lab_run)(const char* words, std::size_t size) {
  return lab::answered([&] { return lab::run(lab::Json::parse(words, words + size)).dump(); });
}
/// The latest run as `abs_hil --csv` writes it.
const char* LAB_EXPORT(lab_csv)() {
  return lab::answered([] { return lab::answer().rows->csv(lab::answer().names); });
}

}  // extern "C"

namespace {
/// The configuration is that of files.cpp.
[[maybe_unused]] const bool has_configuration = [] {
  config::set_own_config_dir("/config");
  return true;
}();
}  // namespace
