#include "study/result_rows.hpp"

#include <fmt/format.h>

#include <iterator>

namespace abs_hil::study {

namespace {

/// In this order: what the columns are.
constexpr const char* first_columns[] = {"run", "plant", "experiment", "controller", "point", "repetition"};

std::string text_of(const config::Value& value) {
  if (const auto* text = std::get_if<std::string>(&value)) return csv_field(*text);
  return std::visit([](const auto& v) { return fmt::format("{}", v); }, value);
}

std::string_view result_of(const Outcome& outcome) {
  if (!outcome.refusal.empty()) return "refused";
  return outcome.run.stopped() ? "completed" : "fault";
}

}  // namespace

std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + '"';
}

std::vector<std::string> result_columns(const Study& study) {
  std::vector<std::string> columns(std::begin(first_columns), std::end(first_columns));
  for (const Factor& factor : study.script().factors) columns.push_back(factor.key);
  columns.insert(columns.end(), {"result", "reason"});
  for (const analysis::Figure& figure : analysis::figures) columns.emplace_back(figure.name);
  for (const SignalMetric& metric : study.script().metrics) columns.push_back(metric.name);
  return columns;
}

std::string result_row(const Study& study, std::uint64_t run, const Outcome& outcome, const std::vector<double>& own) {
  const RunIndex index = study.index_of(run);
  const StudyCase& one = study.cases()[index.study_case];
  std::string row;
  auto out = std::back_inserter(row);
  fmt::format_to(out, "{},{},{},{},{},{}", run, csv_field(one.plant), csv_field(one.experiment),
                 csv_field(study.contenders(index.study_case)[index.contender].name), index.point, index.repetition);
  for (std::size_t i = 0; i < study.script().factors.size(); ++i) row += ',' + text_of(study.value_of(index, i));
  const std::string reason = !outcome.refusal.empty() ? csv_field(outcome.refusal)
                             : outcome.run.stopped()  ? std::string()
                                                      : std::string(rig::row_of(outcome.run.fault).name);
  fmt::format_to(out, ",{},{}", result_of(outcome), reason);
  for (const analysis::Figure& figure : analysis::figures) {
    fmt::format_to(out, ",{}", outcome.refusal.empty() ? figure.of(outcome.run.metrics) : rig::unknown);
  }
  for (std::size_t i = 0; i < study.script().metrics.size(); ++i) {
    fmt::format_to(out, ",{}", own.empty() ? rig::unknown : own[i]);
  }
  return row + '\n';
}

}  // namespace abs_hil::study
