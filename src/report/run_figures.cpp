#include "report/run_figures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <utility>

#include "report/axis.hpp"
#include "report/profile_figure.hpp"
#include "report/run_curves.hpp"

namespace abs_hil::report {

namespace {

constexpr double before_brake_s = 0.2;
constexpr double after_brake_s = 0.2;
/// More than two points per pixel are invisible; with many curves fewer are enough.
constexpr std::size_t most_stretches = 1400;
constexpr std::size_t stretches_of_all_runs = 9000;
constexpr std::size_t least_stretches = 80;
/// More entries would make the legend unreadable.
constexpr std::size_t most_legend_entries = 12;
constexpr double double_panel_px = 165.0;
constexpr double signal_panel_px = 110.0;

std::size_t stretches_for(std::size_t runs) {
  const std::size_t share = stretches_of_all_runs / std::max<std::size_t>(runs, 1);
  return std::clamp(share, least_stretches, most_stretches) / 2 * 2;
}

bool all_brake(const std::vector<RunSurvey>& surveys) {
  return std::all_of(surveys.begin(), surveys.end(), [](const RunSurvey& s) { return s.brakes(); });
}

Window window_of(const RunSurvey& survey, const WindowChoice& choice, bool braking) {
  switch (choice.kind) {
    case WindowChoice::Kind::given: return {choice.range.first, choice.range.second, 0.0};
    case WindowChoice::Kind::run: break;
    case WindowChoice::Kind::brake:
      if (!braking) break;
      return {survey.brake_from_s - before_brake_s, survey.brake_to_s + after_brake_s, survey.brake_from_s};
  }
  return {survey.from_s, survey.to_s, 0.0};
}

/// The simulator's truth if the run has it, else the controller's estimate.
std::string best_of(const RunSurvey& survey, const std::string& truth, const std::string& estimate) {
  return survey.knows(truth) ? truth : estimate;
}

std::vector<Request> requests_for(const RunSurvey& survey, const Window& window) {
  const Window whole{survey.from_s, survey.to_s, 0.0};
  const bool slip_in_braking = survey.brakes();
  const std::string slip = best_of(survey, "slip", "slip_est");
  const std::string torque = best_of(survey, "brake_torque_Nm", "brake_torque_est_Nm");
  std::vector<Request> requests{
      {"profile_omega1", best_of(survey, "omega1_rad_s", "omega1_est_rad_s"), "", false, whole},
      {"profile_omega2", best_of(survey, "omega2_rad_s", "omega2_est_rad_s"), "", false, whole},
      {"omega1", best_of(survey, "omega1_rad_s", "omega1_est_rad_s"), "", false, window},
      {"omega1_est", "omega1_est_rad_s", "", false, window},
      {"omega2", best_of(survey, "omega2_rad_s", "omega2_est_rad_s"), "", false, window},
      {"omega2_est", "omega2_est_rad_s", "", false, window},
      {"slip", slip, "", slip_in_braking, window},
      {"slip_ref", "slip_ref", "", slip_in_braking, window},
      {"slip_error", slip, "slip_ref", slip_in_braking, window},
      {"torque_ref", "brake_torque_ref_Nm", "", false, window},
      {"torque", torque, "", false, window},
      {"theta_est", "theta_est_N", "", false, window},
      {"theta", "theta_N", "", slip_in_braking, window},
      {"theta_error", "theta_N", "theta_est_N", slip_in_braking, window},
      {"distance", "distance_m", "", false, window},
  };
  for (const std::string& signal : survey.signals) requests.push_back({signal, signal, "", false, window});
  return requests;
}

/// A signal's name in gnuplot's enhanced notation, where '_' would lower the next character.
std::string enhanced(const std::string& signal) {
  std::string text;
  for (const char c : signal) text.append(c == '_' ? "\\_" : std::string(1, c));
  return text;
}

/// Makes the figures.
class FigureMaker {
 public:
  FigureMaker(const std::vector<RunFiles>& runs, const std::vector<RunSurvey>& surveys, const RunFigureOptions& options)
      : runs_(runs), surveys_(surveys), options_(options) {
    const bool braking = options.window.kind == WindowChoice::Kind::brake && all_brake(surveys);
    x_label_ = braking ? "time since the start of braking, {/:Italic t} / s" : "time, {/:Italic t} / s";
    Range x{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
    for (std::size_t r = 0; r < runs.size(); ++r) {
      const Window window = window_of(surveys[r], options.window, braking);
      windows_.push_back(window);
      profiles_.push_back(
          read_curves(runs[r], surveys[r], requests_for(surveys[r], window), stretches_for(runs.size())));
      x.first = std::min(x.first, window.from_s - window.zero_s);
      x.second = std::max(x.second, window.to_s - window.zero_s);
    }
    x_range_ = x;
    add_phases();
  }

  [[nodiscard]] std::vector<Figure> figures() const {
    std::vector<Figure> figures;
    figures.push_back(profile_figure(
        runs_, surveys_, profiles_, [this](std::size_t r) { return style(r); }, legend()));
    figures.push_back(speed_figure("fig5", "Figure 5. Upper wheel speed", "omega1", 1));
    figures.push_back(speed_figure("fig6", "Figure 6. Lower wheel speed", "omega2", 2));
    figures.push_back(slip_figure());
    figures.push_back(torque_figure());
    figures.push_back(theta_figure());
    figures.push_back(distance_figure());
    if (Figure signals = signal_figure(); !signals.panels.empty()) figures.push_back(std::move(signals));
    return figures;
  }

 private:
  [[nodiscard]] std::size_t group(std::size_t run) const {
    return options_.groups.empty() ? run : options_.groups[run];
  }

  [[nodiscard]] Style style(std::size_t run) const {
    Style style = run_style(group(run));
    if (options_.paper_colours) style = {group(run) == 0 ? "#000000" : "#9a9a9a", "solid", 1.4};
    if (runs_.size() > most_legend_entries) style.width = 0.6;
    return style;
  }

  [[nodiscard]] std::vector<LegendEntry> legend() const {
    std::vector<LegendEntry> entries;
    if (!options_.group_labels.empty()) {
      for (std::size_t g = 0; g < options_.group_labels.size() && g < most_legend_entries; ++g) {
        entries.push_back({options_.group_labels[g], run_style(g), Drawn::line});
      }
    } else if (runs_.size() <= most_legend_entries) {
      for (std::size_t r = 0; r < runs_.size(); ++r) entries.push_back({runs_[r].label, style(r), Drawn::line});
    }
    return entries;
  }

  /// Shades the phases of the first run, and marks faults and changes of the simulated rig of all runs by lines.
  void add_phases() {
    for (const PhaseInterval& phase : surveys_.front().phases) {
      if (shades_.size() == most_shades) break;
      shades_.push_back({phase.from_s - windows_[0].zero_s, phase.to_s - windows_[0].zero_s, phase.phase});
    }
    for (std::size_t r = 0; r < runs_.size() && r < most_legend_entries; ++r) {
      for (const PhaseInterval& phase : surveys_[r].phases) {
        if (phase.phase == "fault") marks_.push_back({phase.from_s - windows_[r].zero_s, "fault", true});
      }
      for (const RunEvent& event : runs_[r].events) {
        if (event.unusual() && event.phase != "fault" && marks_.size() < most_shades) {
          marks_.push_back({event.time_s - windows_[r].zero_s, event.event, event.event == "fault"});
        }
      }
      for (const PlantChange& change : surveys_[r].plant_changes) {
        mark_once({change.time_s - windows_[r].zero_s, change.label, false});
      }
    }
  }

  /// Adds a mark once: runs of one experiment change alike.
  void mark_once(Mark mark) {
    constexpr double same_s = 1e-6;
    const bool known = std::any_of(marks_.begin(), marks_.end(), [&](const Mark& other) {
      return other.label == mark.label && std::abs(other.x - mark.x) < same_s;
    });
    if (!known && marks_.size() < most_shades) marks_.push_back(std::move(mark));
  }

  [[nodiscard]] Figure begin(std::string id, std::string heading, std::string caption) const {
    Figure figure;
    figure.id = std::move(id);
    figure.heading = std::move(heading);
    figure.caption = std::move(caption);
    figure.x_label = x_label_;
    figure.x_range = x_range_;
    figure.legend = legend();
    figure.shades = shades_;
    figure.marks = marks_;
    return figure;
  }

  void add_curve(Panel& panel, std::size_t run, const std::string& quantity, const Style& curve_style) const {
    const auto found = profiles_[run].find(quantity);
    if (found == profiles_[run].end() || found->second.points.empty()) return;
    panel.curves.push_back({run, quantity, curve_style, found->second.points, Drawn::line, {}});
  }
  void add_all(Panel& panel, const std::string& quantity) const {
    for (std::size_t r = 0; r < runs_.size(); ++r) add_curve(panel, r, quantity, style(r));
  }

  /// Draws a quantity that most runs share as a thin dotted line, each different curve once.
  void add_reference(Panel& panel, const std::string& quantity) const {
    std::vector<std::vector<double>> drawn;
    for (std::size_t r = 0; r < runs_.size(); ++r) {
      std::vector<double> values;
      for (const Point& point : profiles_[r].at(quantity).points) {
        if (values.empty() || point.y != values.back()) values.push_back(point.y);
      }
      if (std::find(drawn.begin(), drawn.end(), values) != drawn.end()) continue;
      drawn.push_back(std::move(values));
      add_curve(panel, r, quantity, reference_style());
    }
  }

  /// Range of y above 3 m/s; towards standstill slip and its estimates diverge.
  [[nodiscard]] std::optional<Range> relevant(const std::vector<std::string>& quantities, Range least) const {
    Range range = least;
    bool any = false;
    for (const auto& run_profiles : profiles_) {
      for (const std::string& quantity : quantities) {
        const Range r = run_profiles.at(quantity).relevant;
        if (r.first > r.second) continue;
        range = {std::min(range.first, r.first), std::max(range.second, r.second)};
        any = true;
      }
    }
    if (!any) return std::nullopt;
    const Axis axis = axis_around(range, static_cast<int>(double_panel_px / px_a_mark));
    return Range{axis.low, axis.high};
  }

  [[nodiscard]] bool truth_everywhere(const std::string& column) const {
    return std::all_of(surveys_.begin(), surveys_.end(), [&](const RunSurvey& s) { return s.knows(column); });
  }
  [[nodiscard]] std::string estimated_note(const std::string& column) const {
    return truth_everywhere(column) ? "" : " Runs without true values show estimates from the encoders.";
  }

  [[nodiscard]] Figure speed_figure(const std::string& id, const std::string& heading, const std::string& quantity,
                                    int wheel) const {
    Figure figure = begin(id, heading, estimated_note(fmt::format("omega{}_rad_s", wheel)));
    if (wheel == 1) {
      figure.caption += " In this and the following figures the background is grey outside braking";
      figure.caption += runs_.size() == 1 ? "." : fmt::format(" of {}.", runs_.front().name);
    }
    Panel panel{.y_label = fmt::format("{{/:Italic ω}}_{} / (rad/s)", wheel), .height_px = 240.0};
    if (runs_.size() == 1 && truth_everywhere(fmt::format("omega{}_rad_s", wheel))) {
      add_curve(panel, 0, quantity + "_est",
                second_style());  // drawn on top and dashed, so that the other curve stays visible
      figure.legend = {{"wheel", style(0), Drawn::line}, {"estimate", second_style(), Drawn::line}};
    }
    add_all(panel, quantity);
    figure.panels.push_back(std::move(panel));
    return figure;
  }

  [[nodiscard]] Figure slip_figure() const {
    Figure figure = begin("fig7", "Figure 7. Wheel slip and tracking error",
                          "(a) slip and its reference (dotted), (b) slip minus reference. The axes cover the range "
                          "above 3 m/s; slip diverges towards standstill." +
                              estimated_note("slip"));
    Panel slip{.y_label = "slip {/:Italic λ}", .y_range = relevant({"slip", "slip_ref"}, {0.0, 0.2})};
    add_all(slip, "slip");
    add_reference(slip, "slip_ref");
    Panel error{.y_label = "{/:Italic λ} − {/:Italic λ}_{ref}", .y_range = relevant({"slip_error"}, {-0.05, 0.05})};
    add_all(error, "slip_error");
    slip.height_px = error.height_px = double_panel_px;
    figure.legend.push_back({"reference", reference_style(), Drawn::line});
    figure.panels = {std::move(slip), std::move(error)};
    return figure;
  }

  [[nodiscard]] Figure torque_figure() const {
    Figure figure = begin("fig8", "Figure 8. Brake torque",
                          "(a) the controller's torque reference, (b) the torque that acts behind the brake's lag." +
                              estimated_note("brake_torque_Nm"));
    Panel asked{.y_label = "reference / (N m)"};
    add_all(asked, "torque_ref");
    Panel acting{.y_label = "acting / (N m)"};
    add_all(acting, "torque");
    asked.height_px = acting.height_px = double_panel_px;
    figure.panels = {std::move(asked), std::move(acting)};
    return figure;
  }

  [[nodiscard]] Figure theta_figure() const {
    const bool truth = std::any_of(surveys_.begin(), surveys_.end(), [](const auto& s) { return s.knows("theta_N"); });
    Figure figure =
        begin("fig9", "Figure 9. Estimate of the friction parameter θ",
              truth ? "(a) estimate, and the plant's θ (dotted), (b) θ minus its estimate. The axes cover the "
                      "range above 3 m/s."
                    : "Estimate only: these runs have no true θ, so the error is unknown.");
    Panel theta{.y_label = "{/:Italic θ} / N", .y_range = relevant({"theta_est", "theta"}, {0.0, 1.0})};
    add_all(theta, "theta_est");
    if (std::all_of(surveys_.begin(), surveys_.end(), [](const auto& s) { return !s.knows("theta_est_N"); })) {
      figure.caption += " No controller of these runs estimates θ.";
    }
    theta.height_px = truth ? double_panel_px : 240.0;
    if (!truth) {
      figure.panels = {std::move(theta)};
      return figure;
    }
    add_reference(theta, "theta");
    figure.legend.push_back({"plant", reference_style(), Drawn::line});
    Panel error{.y_label = "error of {/:Italic θ} / N", .y_range = relevant({"theta_error"}, {-1.0, 1.0})};
    add_all(error, "theta_error");
    error.height_px = double_panel_px;
    figure.panels = {std::move(theta), std::move(error)};
    return figure;
  }

  [[nodiscard]] Figure distance_figure() const {
    Figure figure = begin("fig10", "Figure 10. Braking distance", "Distance of the car since the start of braking.");
    Panel panel{.y_label = "distance / m", .height_px = 240.0};
    add_all(panel, "distance");
    figure.panels.push_back(std::move(panel));
    return figure;
  }

  /// A panel for each signal that a run's controller reports of its own.
  [[nodiscard]] Figure signal_figure() const {
    Figure figure = begin("signals", "The controllers' own signals",
                          "Each panel shows one signal of the runs whose controller reports it.");
    std::vector<std::string> names;
    for (const RunSurvey& survey : surveys_) {
      for (const std::string& signal : survey.signals) {
        if (std::find(names.begin(), names.end(), signal) == names.end()) names.push_back(signal);
      }
    }
    for (const std::string& name : names) {
      Panel panel{.y_label = enhanced(name), .height_px = signal_panel_px};
      add_all(panel, name);
      figure.panels.push_back(std::move(panel));
    }
    return figure;
  }

  static Style reference_style() { return {"#000000", "(2,3)", 1.1}; }
  static Style second_style() { return {"#D55E00", "(7,4)", 1.3}; }
  static constexpr std::size_t most_shades = 200;

  const std::vector<RunFiles>& runs_;
  const std::vector<RunSurvey>& surveys_;
  const RunFigureOptions& options_;
  std::vector<Window> windows_;
  std::vector<Profiles> profiles_;
  std::string x_label_;
  Range x_range_;
  std::vector<Shade> shades_;
  std::vector<Mark> marks_;
};

}  // namespace

std::vector<Figure> run_figures(const std::vector<RunFiles>& runs, const std::vector<RunSurvey>& surveys,
                                const RunFigureOptions& options) {
  return FigureMaker(runs, surveys, options).figures();
}

}  // namespace abs_hil::report
