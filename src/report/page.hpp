#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "report/figure.hpp"
#include "report/run_files.hpp"
#include "report/run_survey.hpp"
#include "report/series_page.hpp"

namespace abs_hil::report {

/// Marks a file as a page of abs_report.
inline constexpr std::string_view page_mark = "<meta name=\"generator\" content=\"abs_report";

/// A figure and its picture for the page.
struct Picture {
  const Figure* figure;
  std::string svg;
};

struct PageContents {
  std::string title{};
  std::string version{};
  const std::vector<RunFiles>* runs{nullptr};
  const std::vector<RunSurvey>* surveys{nullptr};
  std::vector<Picture> pictures{};
  std::vector<std::string> notes{};
  std::vector<SeriesStudy> studies{};
  std::vector<std::string> study_names{};
};

/// A whole page around a body. @param body  HTML
[[nodiscard]] std::string page_around(const std::string& title, const std::string& version, const std::string& body);
[[nodiscard]] std::string picture_html(const Picture& picture);
[[nodiscard]] std::string section(const std::string& heading, const std::string& html);

/// The general report.
[[nodiscard]] std::string report_page(const PageContents& contents);
/// The paper's comparison page: run 0 is the adaptive controller, run 1 the sliding mode.
[[nodiscard]] std::string paper_page(const PageContents& contents);

}  // namespace abs_hil::report
