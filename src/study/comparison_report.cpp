// Writes a comparison as text, Markdown, CSV and JSON.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "analysis/run_summary.hpp"
#include "config/key_table.hpp"
#include "config/model.hpp"
#include "rig/formatted_text.hpp"
#include "study/comparison.hpp"

namespace abs_hil::study {

namespace {

using analysis::Estimate;
using Cells = std::vector<std::vector<std::string>>;

/// "2.331 ± 0.012", followed by the number of runs if some have no value.
std::string shown(const Estimate& e, std::size_t runs, int decimals, bool with_sign) {
  if (e.n == 0) return "-";
  std::string text = with_sign ? fmt::format("{:+.{}f}", e.mean, decimals) : fmt::format("{:.{}f}", e.mean, decimals);
  if (e.n > 1) text += fmt::format(" ± {:.{}f}", e.half_width(), decimals);
  if (e.n < runs) text += fmt::format(" ({} runs)", e.n);
  return text;
}

/// "2.331 [2.301, 2.377]".
std::string shown(const Spread& spread, int decimals) {
  if (std::isnan(spread.median)) return "-";
  return fmt::format("{:.{}f} [{:.{}f}, {:.{}f}]", spread.median, decimals, spread.p10, decimals, spread.p90, decimals);
}

const std::string& name_of(const ComparisonTable& table, std::size_t column) {
  return table.study.contenders(0)[column].name;
}

/// A row for each metric and a column for each controller from number `first` on.
/// @param cell  (column, number of the metric, decimals)
template <class Cell>
Cells cells_of(const ComparisonTable& table, const std::string& corner, std::size_t first, const Cell& cell) {
  Cells cells{{corner}};
  for (std::size_t c = first; c < table.columns.size(); ++c) cells[0].push_back(name_of(table, c));
  for (std::size_t m = 0; m < compared_metrics().size(); ++m) {
    const analysis::Figure& metric = compared_metrics()[m];
    std::vector<std::string>& row = cells.emplace_back();
    const std::string title =  // as `values_of` takes it
        fmt::format("{}{}", metric.title, metric.better == analysis::Better::nearer_zero ? ", size" : "");
    row.push_back(metric.unit.empty() ? title : fmt::format("{} / {}", title, metric.unit));
    for (std::size_t c = first; c < table.columns.size(); ++c)
      row.push_back(cell(table.columns[c], m, metric.decimals));
  }
  return cells;
}

Cells mean_cells(const ComparisonTable& table) {
  Cells cells = cells_of(table, "", 0, [](const ControllerColumn& column, std::size_t m, int decimals) {
    return shown(column.means[m], column.runs, decimals, false);
  });
  cells.push_back({"runs ended by a fault"});
  for (const ControllerColumn& column : table.columns) cells.back().push_back(fmt::format("{}", column.faults));
  cells.push_back({"runs that locked"});
  for (const ControllerColumn& column : table.columns) cells.back().push_back(fmt::format("{}", column.locked));
  return cells;
}

Cells median_cells(const ComparisonTable& table) {
  return cells_of(table, "median [10 %, 90 %]", 0, [](const ControllerColumn& column, std::size_t m, int decimals) {
    return shown(column.spreads[m], decimals);
  });
}

Cells difference_cells(const ComparisonTable& table) {
  return cells_of(table, fmt::format("difference from {}", name_of(table, 0)), 1,
                  [](const ControllerColumn& column, std::size_t m, int decimals) {
                    return shown(column.differences[m], column.runs, decimals, true);
                  });
}

/// Number of characters, not bytes.
std::size_t width_of(const std::string& text) {
  return static_cast<std::size_t>(
      std::ranges::count_if(text, [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U; }));
}

std::string aligned(const Cells& cells) {
  std::vector<std::size_t> widths(cells.front().size(), 0);
  for (const auto& row : cells) {
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], width_of(row[i]));
  }
  std::string text;
  for (const auto& row : cells) {
    text += "  ";
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::string pad(widths[i] - width_of(row[i]), ' ');
      text += i == 0 ? row[i] + pad : "   " + pad + row[i];
    }
    text += '\n';
  }
  return text;
}

std::string in_markdown(const Cells& cells) {
  std::string text;
  for (std::size_t r = 0; r < cells.size(); ++r) {
    text += '|';
    for (const std::string& cell : cells[r]) text += ' ' + cell + " |";
    text += '\n';
    if (r > 0) continue;
    text += "|---|";
    for (std::size_t i = 1; i < cells[r].size(); ++i) text += "---:|";
    text += '\n';
  }
  return text;
}

/// What the labels stand for.
std::string labels(const Study& study) {
  std::string text;
  for (const Contender& contender : study.contenders(0)) {
    if (contender.changes.empty() || contender.name.find('{') != std::string::npos) continue;
    text += fmt::format("{} is {} with", contender.name, contender.settings.control.controller);
    for (std::size_t n = 0; n < contender.changes.size(); ++n) {
      text += fmt::format("{} {} = {}", n == 0 ? "" : ",", contender.changes[n].first, contender.changes[n].second);
    }
    text += ".\n";
  }
  return text;
}

std::string heading(const Study& study) {
  const StudyCase& one = study.cases().front();
  const config::Settings& s = one.settings;
  const RepeatScript& repeat = study.script().repeat;
  const double start_rad_s = s.experiment.start_speed_rad_s;
  const std::string start = start_rad_s > 0.0 ? fmt::format("braking from {} rad/s", start_rad_s) : "from standstill";
  const std::string differs = config::in_words(config::model_differences(s));
  return fmt::format("Plant {}, experiment {}, {} to {} m/s, slip reference {}.\n", one.plant, one.experiment, start,
                     s.experiment.end_speed_m_s, s.control.slip_ref) +
         (differs.empty() ? "" : fmt::format("The model differs from the plant: {}.\n", differs)) + labels(study) +
         fmt::format("{} run{} of each controller, seed {}, plants varied by {}{}.\n", repeat.runs,
                     repeat.runs == 1 ? "" : "s", repeat.seed, repeat.variation.text(),
                     repeat.runs > 1 ? "; mean ± half of the 95 % confidence interval" : "");
}

std::string shown_ratio(const Estimate& ratio) {
  if (ratio.n == 0) return "-";
  const std::string mean = fmt::format("{:.4f}", ratio.mean);
  return ratio.n > 1 ? fmt::format("{} [{:.4f}, {:.4f}]", mean, ratio.low, ratio.high) : mean;
}

std::string ratio_line(const ComparisonTable& table) {
  std::string text = "adaptive / sliding-mode: ";
  for (std::size_t i = 0; i < paper_metrics.size(); ++i) {
    const auto* figure = std::ranges::find(analysis::figures, paper_metrics[i].value, &analysis::Figure::value);
    text += fmt::format("{}{} {}", i == 0 ? "" : ", ", figure->title, shown_ratio((*table.paper_ratios)[i]));
  }
  return text + fmt::format("; the paper: {:.3f} for time and distance ({:.1f} % less).\n", 1.0 - paper_saving,
                            100.0 * paper_saving);
}

/// @param differences  what stands above the table of differences
std::string report(const ComparisonTable& table, std::string (*in_format)(const Cells&), const char* differences) {
  std::string text = heading(table.study) + '\n' + in_format(mean_cells(table));
  if (table.study.script().repeat.runs > 1) text += '\n' + in_format(median_cells(table));
  if (table.columns.size() > 1) text += differences + in_format(difference_cells(table));
  if (table.paper_ratios) text += '\n' + ratio_line(table);
  return text;
}

nlohmann::ordered_json json_of(const Estimate& e) {
  return {{"n", e.n},
          {"mean", analysis::number_or_null(e.mean)},
          {"standard_deviation", analysis::number_or_null(e.standard_deviation)},
          {"ci95_low", analysis::number_or_null(e.low)},
          {"ci95_high", analysis::number_or_null(e.high)}};
}

nlohmann::ordered_json json_of(const Contender& contender, const ControllerColumn& column) {
  nlohmann::ordered_json means;
  nlohmann::ordered_json differences;
  for (std::size_t m = 0; m < compared_metrics().size(); ++m) {
    const std::string key(compared_metrics()[m].name);
    means[key] = json_of(column.means[m]);
    means[key]["p10"] = analysis::number_or_null(column.spreads[m].p10);
    means[key]["median"] = analysis::number_or_null(column.spreads[m].median);
    means[key]["p90"] = analysis::number_or_null(column.spreads[m].p90);
    if (!column.differences.empty()) differences[key] = json_of(column.differences[m]);
  }
  nlohmann::ordered_json changes = nlohmann::ordered_json::object();
  for (const auto& [key, value] : contender.changes) changes[key] = value;
  return {{"name", contender.name},  {"controller", contender.settings.control.controller},
          {"settings", changes},     {"runs", column.runs},
          {"faults", column.faults}, {"locked", column.locked},
          {"metrics", means},        {"difference_from_first", differences}};
}

}  // namespace

std::string to_text(const ComparisonTable& table) {
  return report(table, aligned, "\nDifferences, paired by plant:\n");
}

std::string to_markdown(const ComparisonTable& table) { return report(table, in_markdown, "\n"); }

std::string to_csv(const ComparisonTable& table) {
  constexpr double unknown = rig::unknown;
  std::string text =
      "controller,metric,n,mean,standard_deviation,ci95_low,ci95_high,difference,difference_ci95_low,"
      "difference_ci95_high,p10,median,p90\n";
  for (std::size_t c = 0; c < table.columns.size(); ++c) {
    const ControllerColumn& column = table.columns[c];
    for (std::size_t m = 0; m < compared_metrics().size(); ++m) {
      const Estimate& e = column.means[m];
      const Estimate d = column.differences.empty() ? Estimate{.mean = unknown, .low = unknown, .high = unknown}
                                                    : column.differences[m];
      const Spread& s = column.spreads[m];
      text += fmt::format("{},{},{},{},{},{},{},{},{},{},{},{},{}\n", rig::csv_field(name_of(table, c)),
                          compared_metrics()[m].name, e.n, e.mean, e.standard_deviation, e.low, e.high, d.mean, d.low,
                          d.high, s.p10, s.median, s.p90);
    }
  }
  return text;
}

std::string to_json(const ComparisonTable& table, const std::string& config_json) {
  const StudyCase& one = table.study.cases().front();
  const RepeatScript& repeat = table.study.script().repeat;
  nlohmann::ordered_json controllers = nlohmann::ordered_json::array();
  for (std::size_t c = 0; c < table.columns.size(); ++c)
    controllers.push_back(json_of(table.study.contenders(0)[c], table.columns[c]));
  nlohmann::ordered_json root{{"plant", one.plant},
                              {"experiment", one.experiment},
                              {"start_speed_rad_s", one.settings.experiment.start_speed_rad_s},
                              {"end_speed_m_s", one.settings.experiment.end_speed_m_s},
                              {"slip_ref", one.settings.control.slip_ref},
                              {"repeat", repeat.runs},
                              {"seed", repeat.seed},
                              {"vary", repeat.variation.text()},
                              {"controllers", controllers}};
  if (table.paper_ratios) {
    nlohmann::ordered_json& ratios = root["adaptive_over_sliding_mode"];
    for (std::size_t i = 0; i < paper_metrics.size(); ++i)
      ratios[std::string(paper_metrics[i].key)] = json_of((*table.paper_ratios)[i]);
    ratios["paper"] = 1.0 - paper_saving;
  }
  root["config"] = nlohmann::ordered_json::parse(config_json);
  return root.dump(2) + '\n';
}

std::string runs_csv(const Study& study, const RunsByController& runs) {
  const RepeatScript& repeat = study.script().repeat;
  // The numbers of the plant that the variation changes, by their keys.
  const config::Settings nominal = study.cases().front().settings;
  config::Settings drawn = nominal;
  const config::KeyTable keys(drawn);
  drawn.plant = perturbed(nominal.plant, smallest(repeat.variation));
  std::vector<const config::Key*> varied;
  std::vector<double> least;
  for (const config::Key& key : keys.keys()) {
    if (!key.name.starts_with("plant.") || !std::holds_alternative<double*>(key.target)) continue;
    varied.push_back(&key);
    least.push_back(*std::get<double*>(key.target));
  }
  drawn.plant = nominal.plant;
  for (std::size_t i = varied.size(); i-- > 0;) {
    if (*std::get<double*>(varied[i]->target) == least[i])
      varied.erase(varied.begin() + static_cast<std::ptrdiff_t>(i));
  }
  std::string text = "controller,run,result";
  for (const analysis::Figure& metric : compared_metrics()) text += ',' + std::string(metric.name);
  for (const config::Key* key : varied) text += ',' + key->name;
  text += ",sensor_seed\n";
  for (std::size_t c = 0; c < runs.size(); ++c) {
    for (std::size_t k = 0; k < runs[c].size(); ++k) {
      const RunResult& run = runs[c][k];
      text += fmt::format("{},{},{}", rig::csv_field(study.contenders(0)[c].name), k,
                          run.stopped() ? "completed" : "fault");
      for (const analysis::Figure& metric : compared_metrics()) text += fmt::format(",{}", metric.of(run.metrics));
      const Perturbation perturbation = draw(repeat.variation, repeat.seed, k);
      drawn.plant = perturbed(nominal.plant, perturbation);
      for (const config::Key* key : varied) text += fmt::format(",{}", *std::get<double*>(key->target));
      text += fmt::format(",{}\n", perturbation.sensor_seed);
    }
  }
  return text;
}

}  // namespace abs_hil::study
