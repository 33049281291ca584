#include "report/page.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "report/run_tables.hpp"
#include "report/text.hpp"

namespace abs_hil::report {

namespace {

constexpr std::size_t most_open_rows = 12;

/// Forbids scripts and external images, so that a run's files cannot inject active content.
constexpr std::string_view policy = "default-src 'none'; style-src 'unsafe-inline'";

constexpr std::string_view style = R"(
:root { color-scheme: light; }
body { font: 16px/1.45 "Liberation Serif", "Times New Roman", Times, serif; color: #1a1a1a; background: #fff;
  max-width: 880px; margin: 2.2em auto; padding: 0 1.2em; }
h1 { font-size: 1.7em; line-height: 1.2; margin: 0 0 .3em; font-weight: 600; }
h2 { font-size: 1.22em; margin: 2em 0 .5em; border-bottom: 1px solid #bbb; padding-bottom: .15em; font-weight: 600; }
.lead { color: #555; margin: 0 0 1.2em; }
figure { margin: 1.6em 0 2em; break-inside: avoid; }
figure svg { width: 100%; height: auto; display: block; }
figcaption { font-size: .92em; margin-top: .35em; padding: 0 .5em 0 4.9em; }
figcaption b { font-weight: 600; }
.wide { overflow-x: auto; margin: .6em 0 1em; }
table { border-collapse: collapse; font-size: .9em; border-top: 1.5px solid #222; border-bottom: 1.5px solid #222; }
thead tr { border-bottom: 1px solid #222; }
th, td { padding: .18em .8em .18em 0; text-align: left; vertical-align: top; font-weight: 400; }
thead th { font-weight: 600; }
tbody th { white-space: nowrap; }
table.numbers td, table.numbers thead th:not(:first-child) { text-align: right; font-variant-numeric: tabular-nums; }
td { overflow-wrap: break-word; max-width: 26em; }
#notes { font-size: .92em; color: #333; }
details summary { cursor: pointer; }
.says { font-size: .93em; margin: .2em .5em 1.6em 4.9em; }
.says dt { font-weight: 600; float: left; clear: left; width: 6.2em; }
.says dd { margin: 0 0 .25em 6.4em; }
footer { margin-top: 3em; font-size: .85em; color: #666; border-top: 1px solid #bbb; padding-top: .4em; }
@media print { body { max-width: none; margin: 0; } details > * { display: block; } }
)";

std::string folded(const std::string& summary, const std::string& html, bool open) {
  return fmt::format("<details{}><summary>{}</summary>\n{}</details>\n", open ? " open" : "", html_escape(summary),
                     html);
}

std::string series_sections(const PageContents& contents) {
  std::string body;
  std::size_t next = 0;
  for (std::size_t i = 0; i < contents.studies.size(); ++i) {
    std::string html = series_table(contents.studies[i], *contents.runs, *contents.surveys);
    if (contents.studies[i].groups.size() > most_open_rows) html = folded("table", html, false);
    while (next < contents.pictures.size() && !contents.pictures[next].figure->id.starts_with("series")) ++next;
    if (next < contents.pictures.size()) html.insert(0, picture_html(contents.pictures[next++]));
    body += section("Series " + contents.study_names[i], html);
  }
  return body;
}

}  // namespace

std::string page_around(const std::string& title, const std::string& version, const std::string& body) {
  std::string page = "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n";
  page += fmt::format("{} {}\">\n", page_mark, html_escape(version));
  page += fmt::format("<meta http-equiv=\"Content-Security-Policy\" content=\"{}\">\n", policy);
  page += "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n";
  page += fmt::format("<title>{}</title>\n<style>{}</style>\n</head>\n<body>\n", html_escape(title), style);
  page += fmt::format("<h1>{}</h1>\n{}", html_escape(title), body);
  page += fmt::format("<footer>Made by abs_report {}; figures drawn by gnuplot.</footer>\n</body>\n</html>\n",
                      html_escape(version));
  return page;
}

std::string picture_html(const Picture& picture) {
  return fmt::format("<figure id=\"figure-{}\">\n{}\n<figcaption><b>{}.</b> {}</figcaption>\n</figure>\n",
                     html_escape(picture.figure->id), picture.svg, html_escape(picture.figure->heading),
                     html_escape(picture.figure->caption));
}

std::string section(const std::string& heading, const std::string& html) {
  return html.empty() ? "" : fmt::format("<h2>{}</h2>\n{}", html_escape(heading), html);
}

std::string report_page(const PageContents& contents) {
  const std::vector<RunFiles>& runs = *contents.runs;
  const std::vector<RunSurvey>& surveys = *contents.surveys;
  std::string lead = fmt::format("{} run{}", runs.size(), runs.size() == 1 ? "" : "s");
  std::vector<std::string> experiments;
  for (const RunFiles& run : runs) {
    const std::string name = run.text("experiment");
    if (!name.empty() && std::find(experiments.begin(), experiments.end(), name) == experiments.end()) {
      experiments.push_back(name);
    }
  }
  if (!experiments.empty()) {
    lead += fmt::format(", experiment{} {}", experiments.size() == 1 ? "" : "s", fmt::join(experiments, ", "));
  }
  std::string body = fmt::format("<p class=\"lead\">{}</p>\n", html_escape(lead));
  body += series_sections(contents);
  const std::string metrics = metrics_table(runs, surveys);
  body += section("Figures of merit", runs.size() > most_open_rows ? folded("every run", metrics, false) : metrics);
  std::string pictures;
  std::string timing;
  for (const Picture& picture : contents.pictures) {
    if (picture.figure->id.starts_with("series")) continue;
    (picture.figure->id == "timing" ? timing : pictures) += picture_html(picture);
  }
  body += section(runs.size() == 1 ? "Time history of the run" : "Time histories of the runs", pictures);
  const std::string differences = differences_table(runs);
  if (runs.size() > 1) {
    body +=
        section("Differences in configuration",
                differences.empty() ? "<p>No differences are known.</p>\n"
                                    : folded("keys whose values differ", differences, runs.size() <= most_open_rows));
  }
  std::string real_time = timing + timing_table(runs);
  if (real_time.empty()) real_time = "<p>No timing is known: the runs were in virtual time or have no summary.</p>\n";
  body += section("Real time", real_time);
  body += section("Events", folded("events", events_table(runs, surveys), runs.size() <= most_open_rows));
  body += section("Environment", folded("machines and builds", environment_table(runs), false));
  body += section("Notes", notes_list(contents.notes));
  return page_around(contents.title, contents.version, body);
}

}  // namespace abs_hil::report
