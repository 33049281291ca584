// Writes the comparison as text, Markdown, CSV and JSON.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "analysis/json_number.hpp"
#include "config/key_table.hpp"
#include "study/comparison_table.hpp"
#include "study/result_rows.hpp"

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

std::string title_of(const analysis::Figure& metric) {
  return metric.unit.empty() ? std::string(metric.title) : fmt::format("{} / {}", metric.title, metric.unit);
}

/// Rows of means: one row per metric, one column per controller.
Cells mean_cells(const ComparisonTable& table) {
  Cells cells{{""}};
  for (const ControllerColumn& column : table.columns) cells[0].push_back(column.name);
  for (std::size_t m = 0; m < compared_metrics().size(); ++m) {
    const analysis::Figure& metric = compared_metrics()[m];
    std::vector<std::string>& row = cells.emplace_back(1, title_of(metric));
    for (const ControllerColumn& column : table.columns) {
      row.push_back(shown(column.means[m], column.runs, metric.decimals, false));
    }
  }
  cells.push_back({"runs ended by a fault"});
  cells.push_back({"runs that locked"});
  for (const ControllerColumn& column : table.columns) {
    cells[cells.size() - 2].push_back(fmt::format("{}", column.faults));
    cells.back().push_back(fmt::format("{}", column.locked));
  }
  return cells;
}

/// "2.331 [2.301, 2.377]".
std::string shown(const Spread& spread, int decimals) {
  if (std::isnan(spread.median)) return "-";
  return fmt::format("{:.{}f} [{:.{}f}, {:.{}f}]", spread.median, decimals, spread.p10, decimals, spread.p90, decimals);
}

/// Rows of medians with the 10th and the 90th percentile.
Cells median_cells(const ComparisonTable& table) {
  Cells cells{{"median [10 %, 90 %]"}};
  for (const ControllerColumn& column : table.columns) cells[0].push_back(column.name);
  for (std::size_t m = 0; m < compared_metrics().size(); ++m) {
    const analysis::Figure& metric = compared_metrics()[m];
    std::vector<std::string>& row = cells.emplace_back(1, title_of(metric));
    for (const ControllerColumn& column : table.columns) row.push_back(shown(column.spreads[m], metric.decimals));
  }
  return cells;
}

Cells difference_cells(const ComparisonTable& table) {
  Cells cells{{fmt::format("less {}", table.columns.front().name)}};
  for (std::size_t c = 1; c < table.columns.size(); ++c) cells[0].push_back(table.columns[c].name);
  for (std::size_t m = 0; m < compared_metrics().size(); ++m) {
    const analysis::Figure& metric = compared_metrics()[m];
    std::vector<std::string>& row = cells.emplace_back(1, title_of(metric));
    for (std::size_t c = 1; c < table.columns.size(); ++c) {
      row.push_back(shown(table.columns[c].differences[m], table.repeat, metric.decimals, true));
    }
  }
  return cells;
}

/// Number of characters, not bytes.
std::size_t width_of(const std::string& text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U; }));
}

std::string aligned(const Cells& cells) {
  std::vector<std::size_t> widths(cells.front().size(), 0);
  for (const auto& row : cells) {
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], width_of(row[i]));
  }
  std::string text;
  for (const auto& row : cells) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::string pad(widths[i] - width_of(row[i]), ' ');
      line += i == 0 ? row[i] + pad : "   " + pad + row[i];
    }
    text += "  " + line + '\n';
  }
  return text;
}

std::string markdown(const Cells& cells) {
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
std::string labels(const ComparisonTable& t) {
  std::string text;
  for (const ControllerColumn& column : t.columns) {
    if (column.changes.empty() || column.name.find('{') != std::string::npos) continue;
    text += fmt::format("{} is {} with", column.name, column.controller);
    for (std::size_t n = 0; n < column.changes.size(); ++n) {
      text += fmt::format("{} {} = {}", n == 0 ? "" : ",", column.changes[n].first, column.changes[n].second);
    }
    text += ".\n";
  }
  return text;
}

std::string heading(const ComparisonTable& t) {
  const std::string start =
      t.start_speed_rad_s > 0.0 ? fmt::format("braking from {} rad/s", t.start_speed_rad_s) : "from standstill";
  return fmt::format("Plant {}, experiment {}, {} to {} m/s, slip reference {}.\n", t.plant, t.experiment, start,
                     t.end_speed_m_s, t.slip_ref) +
         (t.model_note.empty() ? "" : fmt::format("The model differs from the plant: {}.\n", t.model_note)) +
         labels(t) +
         fmt::format("{} run{} of each controller, seed {}, plants varied by {}{}.\n", t.repeat,
                     t.repeat == 1 ? "" : "s", t.seed, t.variation.text(),
                     t.repeat > 1 ? "; mean ± half of the 95 % confidence interval" : "");
}

std::string shown_ratio(const Estimate& ratio) {
  if (ratio.n == 0) return "-";
  const std::string mean = fmt::format("{:.4f}", ratio.mean);
  return ratio.n > 1 ? fmt::format("{} [{:.4f}, {:.4f}]", mean, ratio.low, ratio.high) : mean;
}

std::string ratio_line(const PaperRatio& r) {
  return fmt::format(
      "adaptive / sliding-mode: stop time {}, stop distance {}, slip RMS error {}, torque variation {}; the paper: "
      "{:.3f} for time and "
      "distance ({:.1f} % less).\n",
      shown_ratio(r.stop_time), shown_ratio(r.stop_distance), shown_ratio(r.slip_rms),
      shown_ratio(r.torque_total_variation), 1.0 - paper_saving, 100.0 * paper_saving);
}

/// The keys of the plant's values that the plan's variation changes.
/// @param drawn  the settings behind `keys`; left as they were
std::vector<const config::Key*> varied_keys(const ComparisonPlan& plan, const config::KeyTable& keys,
                                            config::Settings& drawn) {
  std::vector<double> before;
  const auto is_number = [](const config::Key& key) {
    return key.name.starts_with("plant.") && std::holds_alternative<double*>(key.target);
  };
  for (const config::Key& key : keys.keys()) {
    if (is_number(key)) before.push_back(*std::get<double*>(key.target));
  }
  drawn.plant = perturbed(plan.settings.plant, smallest(plan.variation));
  std::vector<const config::Key*> varied;
  auto at = before.begin();
  for (const config::Key& key : keys.keys()) {
    if (is_number(key) && *std::get<double*>(key.target) != *at++) varied.push_back(&key);
  }
  drawn.plant = plan.settings.plant;
  return varied;
}

nlohmann::ordered_json json_of(const Estimate& e) {
  return {{"n", e.n},
          {"mean", analysis::number_or_null(e.mean)},
          {"standard_deviation", analysis::number_or_null(e.standard_deviation)},
          {"ci95_low", analysis::number_or_null(e.low)},
          {"ci95_high", analysis::number_or_null(e.high)}};
}

}  // namespace

std::string to_text(const ComparisonTable& table) {
  std::string text = heading(table) + '\n' + aligned(mean_cells(table));
  if (table.repeat > 1) text += '\n' + aligned(median_cells(table));
  if (table.columns.size() > 1) {
    text += "\nDifferences, paired by plant:\n" + aligned(difference_cells(table));
  }
  if (table.paper_ratio) text += '\n' + ratio_line(*table.paper_ratio);
  return text;
}

std::string to_markdown(const ComparisonTable& table) {
  std::string text = heading(table) + '\n' + markdown(mean_cells(table));
  if (table.repeat > 1) text += '\n' + markdown(median_cells(table));
  if (table.columns.size() > 1) text += '\n' + markdown(difference_cells(table));
  if (table.paper_ratio) text += '\n' + ratio_line(*table.paper_ratio);
  return text;
}

std::string to_csv(const ComparisonTable& table) {
  std::string text =
      "controller,metric,n,mean,standard_deviation,ci95_low,ci95_high,difference,difference_ci95_low,"
      "difference_ci95_high,p10,median,p90\n";
  for (const ControllerColumn& column : table.columns) {
    for (std::size_t m = 0; m < compared_metrics().size(); ++m) {
      const Estimate& e = column.means[m];
      const double unknown = rig::unknown;
      const Estimate d = column.differences.empty() ? Estimate{.mean = unknown, .low = unknown, .high = unknown}
                                                    : column.differences[m];
      const Spread& s = column.spreads[m];
      text +=
          fmt::format("{},{},{},{},{},{},{},{},{},{},{},{},{}\n", csv_field(column.name), compared_metrics()[m].name,
                      e.n, e.mean, e.standard_deviation, e.low, e.high, d.mean, d.low, d.high, s.p10, s.median, s.p90);
    }
  }
  return text;
}

std::string to_json(const ComparisonTable& t, const std::string& config_json) {
  nlohmann::ordered_json controllers = nlohmann::ordered_json::array();
  for (const ControllerColumn& column : t.columns) {
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
    for (const auto& [key, value] : column.changes) changes[key] = value;
    controllers.push_back({{"name", column.name},
                           {"controller", column.controller},
                           {"settings", changes},
                           {"runs", column.runs},
                           {"faults", column.faults},
                           {"locked", column.locked},
                           {"metrics", means},
                           {"difference_from_first", differences}});
  }
  nlohmann::ordered_json root{{"plant", t.plant},
                              {"experiment", t.experiment},
                              {"start_speed_rad_s", t.start_speed_rad_s},
                              {"end_speed_m_s", t.end_speed_m_s},
                              {"slip_ref", t.slip_ref},
                              {"repeat", t.repeat},
                              {"seed", t.seed},
                              {"vary", t.variation.text()},
                              {"controllers", controllers}};
  if (t.paper_ratio) {
    root["adaptive_over_sliding_mode"] = {{"stop_time", json_of(t.paper_ratio->stop_time)},
                                          {"stop_distance", json_of(t.paper_ratio->stop_distance)},
                                          {"slip_rms", json_of(t.paper_ratio->slip_rms)},
                                          {"torque_total_variation", json_of(t.paper_ratio->torque_total_variation)},
                                          {"paper", 1.0 - paper_saving}};
  }
  root["config"] = nlohmann::ordered_json::parse(config_json);
  return root.dump(2) + '\n';
}

std::string runs_csv(const ComparisonPlan& plan, const Comparison& comparison) {
  // The drawn plants, by the keys of what may differ between them.
  config::Settings drawn = plan.settings;
  const config::KeyTable keys(drawn);
  const std::vector<const config::Key*> varied = varied_keys(plan, keys, drawn);
  std::string text = "controller,run,result";
  for (const analysis::Figure& metric : compared_metrics()) text += ',' + std::string(metric.name);
  for (const config::Key* key : varied) text += ',' + key->name;
  text += ",sensor_seed\n";
  for (std::size_t c = 0; c < comparison.contenders.size(); ++c) {
    for (std::size_t k = 0; k < comparison.results[c].size(); ++k) {
      const RunResult& run = comparison.results[c][k];
      text +=
          fmt::format("{},{},{}", csv_field(comparison.contenders[c].name), k, run.stopped() ? "completed" : "fault");
      for (const analysis::Figure& metric : compared_metrics()) text += fmt::format(",{}", metric.of(run.metrics));
      const Perturbation perturbation = draw(plan.variation, plan.seed, k);
      drawn.plant = perturbed(plan.settings.plant, perturbation);
      for (const config::Key* key : varied) text += fmt::format(",{}", *std::get<double*>(key->target));
      text += fmt::format(",{}\n", perturbation.sensor_seed);
    }
  }
  return text;
}

}  // namespace abs_hil::study
