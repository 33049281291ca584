#pragma once

#include <optional>
#include <vector>

#include "report/figure.hpp"
#include "report/run_files.hpp"
#include "report/run_survey.hpp"

namespace abs_hil::report {

/// Which part of the runs the figures show.
struct WindowChoice {
  enum class Kind {
    brake,  ///< braking with a margin on both sides; zero at its start
    run,    ///< the whole run
    given   ///< `range`, in the run's own time
  } kind{Kind::brake};
  Range range{0.0, 0.0};
};

struct RunFigureOptions {
  WindowChoice window{};
  bool paper_colours{false};  ///< black and grey, as in the paper
  /// Index of each run's group. Runs of one group share a style. Empty: every run is its own group.
  std::vector<std::size_t> groups{};
  std::vector<std::string> group_labels{};
};

/// The figure of the whole runs, and the counterparts of the paper's figures 5 to 10. Reads each CSV once.
[[nodiscard]] std::vector<Figure> run_figures(const std::vector<RunFiles>& runs, const std::vector<RunSurvey>& surveys,
                                              const RunFigureOptions& options);

/// Histograms of the cycle's timing; empty if no run has any.
[[nodiscard]] std::optional<Figure> timing_figure(const std::vector<RunFiles>& runs);

}  // namespace abs_hil::report
