#include "report/report.hpp"

#include <fmt/format.h>

#include <fstream>
#include <stdexcept>

#include "report/input_error.hpp"
#include "report/page.hpp"
#include "report/run_details.hpp"
#include "report/run_tables.hpp"
#include "report/series_page.hpp"
#include "report/text.hpp"

namespace abs_hil::report {

namespace fs = std::filesystem;

namespace {

/// Number of groups that the palette can distinguish.
constexpr std::size_t most_group_styles = 7;
constexpr std::size_t mark_bytes = 4096;

std::string read_file(const fs::path& path, std::size_t most) {
  std::ifstream file(path, std::ios::binary);
  std::string text(most, '\0');
  file.read(text.data(), static_cast<std::streamsize>(most));
  text.resize(static_cast<std::size_t>(file.gcount()));
  return text;
}

/// Puts the adaptive controller's run first, as the paper's page requires.
void order_for_paper(std::vector<RunFiles>& runs, std::vector<std::string>& notes) {
  if (runs.size() != 2) {
    throw InputError(fmt::format("--paper compares two runs, adaptive and sliding-mode; give two runs: {} {} given",
                                 runs.size(), runs.size() == 1 ? "was" : "were"));
  }
  if (runs[1].text("controller") == "adaptive" && runs[0].text("controller") != "adaptive") std::swap(runs[0], runs[1]);
  for (std::size_t r = 0; r < 2; ++r) {
    const std::string controller = runs[r].text("controller");
    const std::string wanted = r == 0 ? "adaptive" : "sliding-mode";
    if (controller == wanted) continue;
    notes.push_back(fmt::format("{} is shown as {}, but its controller is {}", runs[r].name, wanted,
                                controller.empty() ? "not known" : controller));
  }
  if (runs[0].text("plant") != runs[1].text("plant")) notes.emplace_back("the two runs have different plants");
}

std::string title_of(const ReportOptions& options, const std::vector<RunFiles>& runs,
                     const std::vector<Series>& series) {
  if (!options.title.empty()) return clean_text(options.title);
  if (options.paper) return "The paper’s comparison: figures 5 to 10";
  if (!series.empty()) return "Series " + series.front().name;
  std::string title = "Run " + runs.front().label;
  if (runs.size() == 2) title = "Runs " + runs.front().label + " and " + runs.back().label;
  if (runs.size() > 2) title = fmt::format("{} runs, {} to {}", runs.size(), runs.front().name, runs.back().name);
  return title;
}

/// Gives runs of one series of runs a style for each varied value, if the palette has enough colours.
void group_styles(const std::vector<SeriesStudy>& studies, std::size_t runs, RunFigureOptions& options) {
  if (studies.size() != 1 || studies[0].groups.size() > most_group_styles) return;
  std::vector<std::size_t> groups(runs, most_group_styles);
  for (std::size_t g = 0; g < studies[0].groups.size(); ++g) {
    for (const std::size_t r : studies[0].groups[g].runs) groups[r] = g;
    options.group_labels.push_back(studies[0].groups[g].label);
  }
  for (const std::size_t group : groups) {
    if (group == most_group_styles) {
      options.group_labels.clear();  // there are also runs outside the series
      return;
    }
  }
  options.groups = std::move(groups);
}

}  // namespace

Report make_report(const ReportOptions& options) {
  FoundRuns found = find_runs(options.runs, options.labels);
  if (options.paper) order_for_paper(found.runs, found.notes);
  PageContents contents;
  std::vector<RunSurvey> surveys;
  surveys.reserve(found.runs.size());
  for (const RunFiles& run : found.runs) surveys.push_back(survey(run));

  Report report;
  RunFigureOptions figure_options{.window = options.window, .paper_colours = options.paper};
  for (const Series& series : found.series) {
    contents.studies.push_back(study(series, found.runs));
    contents.study_names.push_back(series.name);
    report.figures.push_back(
        series_figure(fmt::format("series{}", contents.studies.size()), contents.studies.back(), found.runs, surveys));
  }
  group_styles(contents.studies, found.runs.size(), figure_options);
  for (Figure& figure : run_figures(found.runs, surveys, figure_options)) report.figures.push_back(std::move(figure));
  if (auto timing = timing_figure(found.runs)) report.figures.push_back(std::move(*timing));

  const TemporaryFolder folder;
  draw(report.figures, PictureFormat::svg, folder.path());
  for (const Figure& figure : report.figures) {
    contents.pictures.push_back({&figure, embeddable_svg(read_text(folder.path() / (figure.id + ".svg")), figure)});
  }
  contents.title = title_of(options, found.runs, found.series);
  contents.version = options.version;
  contents.runs = &found.runs;
  contents.surveys = &surveys;
  contents.notes = report.notes = all_notes(found.runs, surveys, found.notes);
  report.html = options.paper ? paper_page(contents) : report_page(contents);
  return report;
}

std::vector<fs::path> write_figures(const Report& report, const fs::path& folder, PictureFormat format, bool replace) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw InputError(fmt::format("cannot create the folder \"{}\": {}", folder.string(), error.message()));
  std::vector<fs::path> paths;
  for (const Figure& figure : report.figures) {
    paths.push_back(folder / fmt::format("{}.{}", figure.id, extension_of(format)));
    if (!replace && fs::exists(paths.back(), error)) {
      throw InputError(
          fmt::format("\"{}\" exists; give another folder, or --force to replace it", paths.back().string()));
    }
  }
  const TemporaryFolder drawn;
  draw(report.figures, format, drawn.path());
  for (const fs::path& path : paths) {
    std::string picture = read_text(drawn.path() / path.filename());
    if (format == PictureFormat::svg) picture = with_common_fonts(std::move(picture));
    std::ofstream file(path, std::ios::binary);
    file << picture;
    file.close();
    if (!file) throw InputError(fmt::format("cannot write \"{}\"; give a writable folder", path.string()));
  }
  return paths;
}

void check_replaceable(const fs::path& path, bool replace) {
  std::error_code ignored;
  if (replace || !fs::exists(path, ignored)) return;
  if (read_file(path, mark_bytes).find(page_mark) != std::string::npos) return;
  throw InputError(
      fmt::format("\"{}\" exists and is not a report of abs_report; give another --output, or --force to "
                  "replace it",
                  path.string()));
}

}  // namespace abs_hil::report
