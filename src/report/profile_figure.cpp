#include "report/profile_figure.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "report/text.hpp"

namespace abs_hil::report {

namespace {

constexpr std::size_t most_strips = 12;
constexpr std::size_t most_bars = 60;  ///< per run; more would be unreadable
constexpr double strip_px = 24.0;
constexpr std::size_t short_name_characters = 8;

/// One strip per run with its phases, and marks at unusual events.
Panel phase_strips(const std::vector<RunFiles>& runs, const std::vector<RunSurvey>& surveys) {
  const std::size_t strips = std::min(runs.size(), most_strips);
  Panel panel{.y_label = "", .y_range = Range{0.0, static_cast<double>(strips)}};
  panel.height_px = std::max(30.0, strip_px * static_cast<double>(strips));
  panel.grid = false;
  std::vector<std::string> names;
  for (std::size_t r = 0; r < strips; ++r) names.push_back(strips == 1 ? "" : runs[r].name);
  names = short_names(names, short_name_characters);
  for (std::size_t r = 0; r < strips; ++r) {
    const double bottom = static_cast<double>(strips - 1 - r);
    panel.y_tics.emplace_back(bottom + 0.5, names[r]);
    for (std::size_t i = 0; i < std::min(surveys[r].phases.size(), most_bars); ++i) {
      const PhaseInterval& phase = surveys[r].phases[i];
      panel.bars.push_back(
          {phase.from_s, phase.to_s, bottom + 0.12, bottom + 0.88, phase_colour(phase.phase), phase.phase});
    }
    Curve events{r, "events", {"#D55E00", "solid", 1.0, 9}, {}, Drawn::markers, {}};
    for (const RunEvent& event : runs[r].events) {
      if (event.unusual() && events.points.size() < most_bars) events.points.push_back({event.time_s, bottom + 0.5});
    }
    for (const PhaseInterval& phase : surveys[r].phases) {
      if (phase.phase == "fault" && runs[r].events.empty()) events.points.push_back({phase.from_s, bottom + 0.5});
    }
    for (const PlantChange& change : surveys[r].plant_changes) {
      if (events.points.size() < most_bars) events.points.push_back({change.time_s, bottom + 0.5});
    }
    if (!events.points.empty()) panel.curves.push_back(std::move(events));
  }
  return panel;
}

}  // namespace

Figure profile_figure(const std::vector<RunFiles>& runs, const std::vector<RunSurvey>& surveys,
                      const std::vector<Profiles>& profiles, const std::function<Style(std::size_t)>& style,
                      std::vector<LegendEntry> legend) {
  Figure figure;
  figure.id = "profile";
  figure.heading = runs.size() == 1 ? "Time history of the run" : "Time histories of the runs";
  figure.x_label = "time since the start of the run, {/:Italic t} / s";
  Range x{surveys.front().from_s, surveys.front().to_s};
  for (const RunSurvey& survey : surveys) {
    x = {std::min(x.first, survey.from_s), std::max(x.second, survey.to_s)};
  }
  figure.x_range = x;
  Panel speeds{.y_label = "speed / (rad/s)", .height_px = 200.0};
  const Style upper{"#909090", "(3,3)", 1.0};
  for (std::size_t r = 0; r < runs.size(); ++r) {
    if (!profiles[r].at("profile_omega2").points.empty()) {
      speeds.curves.push_back({r, "omega2", style(r), profiles[r].at("profile_omega2").points, Drawn::line, {}});
    }
  }
  if (runs.size() == 1 && !profiles[0].at("profile_omega1").points.empty()) {
    speeds.curves.push_back({0, "omega1", upper, profiles[0].at("profile_omega1").points, Drawn::line, {}});
    legend = {{"lower wheel ω₂ (the road)", style(0), Drawn::line}, {"upper wheel ω₁ (braked)", upper, Drawn::line}};
  }
  figure.legend = std::move(legend);
  figure.caption = runs.size() == 1 ? "(a) Speeds of both wheels. " : "(a) Speed of the lower wheel, the road. ";
  figure.caption += "(b) Phases of the run";
  if (runs.size() > 1) figure.caption += "s";
  figure.caption += "; a triangle marks an event other than a change of phase.";
  if (runs.size() > most_strips) {
    figure.caption += fmt::format(" Only the first {} of {} runs are shown.", most_strips, runs.size());
  }
  figure.panels = {std::move(speeds), phase_strips(runs, surveys)};
  return figure;
}

}  // namespace abs_hil::report
