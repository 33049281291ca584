#include <fmt/format.h>

#include <cmath>
#include <map>

#include "report/metric_list.hpp"
#include "report/page.hpp"
#include "report/run_tables.hpp"
#include "report/table.hpp"
#include "report/text.hpp"

namespace abs_hil::report {

namespace {

/// The paper's claim: "approximately 6.7 % less time and distance".
constexpr double claimed_per_cent = -6.7;
/// The paper's plots show braking from 6.2 to 7.4 s.
constexpr double plotted_stop_s = 1.2;

/// Values of a metric: of the adaptive controller and of its baseline.
class Pair {
 public:
  Pair(const PageContents& contents, std::string_view key) : metric_(metric(key)) {
    for (std::size_t r = 0; r < 2; ++r) values_[r] = value_of(metric_, (*contents.runs)[r], (*contents.surveys)[r]);
  }
  [[nodiscard]] std::string operator[](std::size_t r) const { return shown(values_[r], metric_.decimals); }
  [[nodiscard]] double per_cent() const { return 100.0 * (values_[0] / values_[1] - 1.0); }
  [[nodiscard]] bool less() const { return values_[0] < values_[1]; }
  [[nodiscard]] bool known() const { return std::isfinite(values_[0]) && std::isfinite(values_[1]); }

 private:
  const Metric& metric_;
  double values_[2]{};
};

std::string signed_per_cent(double value) {
  return std::isfinite(value) ? fmt::format("{}{} %", value > 0.0 ? "+" : "", shown(value, 1)) : "–";
}

std::string holds_if(bool known, bool holds) { return !known ? "Cannot be judged" : holds ? "Holds" : "Does not hold"; }

std::string settled(const Pair& pair, std::size_t r) {
  return pair[r] == "–" ? "never settles within 0.02" : fmt::format("settles after {} s", pair[r]);
}

struct Words {
  std::string paper;
  std::string ours;
};

/// For each of the paper's figures: a paraphrase of its statement, and the result of these two runs.
std::map<std::string, Words> words(const PageContents& c) {
  const Pair time(c, "stop_time_s");
  const Pair distance(c, "stop_distance_m");
  const Pair rms(c, "slip_rms");
  const Pair settling(c, "slip_settling_s");
  const Pair variation(c, "torque_total_variation_Nm");
  const Pair theta_error(c, "theta_error_final");
  const std::string times =
      fmt::format("{}: stop times {} s and {} s.", holds_if(time.known(), time.less()), time[0], time[1]);
  const std::string wheels = "Both controllers decelerate; the proposed one stops a few tenths of a second earlier.";
  return {
      {"fig5", {wheels, times}},
      {"fig6", {wheels, times}},
      {"fig7",
       {"The proposed controller reaches the slip 0.15 faster and stays closer to it. Towards standstill the "
        "performance "
        "is no longer relevant.",
        fmt::format("{}: RMS errors {} and {}; the first {}, the second {}.", holds_if(rms.known(), rms.less()), rms[0],
                    rms[1], settled(settling, 0), settled(settling, 1))}},
      {"fig8",
       {"No chattering, which the sliding mode shows.",
        fmt::format("{}: the torque references vary by {} N m and {} N m in total.",
                    holds_if(variation.known(), variation.less()), variation[0], variation[1])}},
      {"fig9",
       {"Estimates of both controllers; unreliable at the end of braking.",
        fmt::format("Relative errors of the estimates at 3 m/s: {} and {}.", theta_error[0], theta_error[1])}},
      {"fig10",
       {fmt::format("About {} % less time and distance.", shown(-claimed_per_cent, 1)),
        fmt::format("Time {}, distance {} against the sliding mode.", signed_per_cent(time.per_cent()),
                    signed_per_cent(distance.per_cent()))}},
  };
}

std::string claims_table(const PageContents& c) {
  const Pair time(c, "stop_time_s");
  const Pair distance(c, "stop_distance_m");
  const std::string claim = signed_per_cent(claimed_per_cent);
  Table table{"claims", {"", "the paper", "these runs"}, {}, true};
  table.rows = {
      {"stop time, adaptive against sliding mode", claim, signed_per_cent(time.per_cent())},
      {"stop distance, adaptive against sliding mode", claim, signed_per_cent(distance.per_cent())},
      {"stop time of the adaptive controller / s", fmt::format("about {}", shown(plotted_stop_s, 1)), time[0]},
      {"runs of each controller", "1", "1"},
  };
  return table.html();
}

}  // namespace

std::string paper_page(const PageContents& contents) {
  const std::vector<RunFiles>& runs = *contents.runs;
  std::string body = fmt::format(
      "<p class=\"lead\">Black: {}. Grey: {}. Plant: {}, {}.</p>\n", html_escape(runs[0].label),
      html_escape(runs[1].label), html_escape(runs[0].text("plant").empty() ? "unknown" : runs[0].text("plant")),
      html_escape(runs[0].text("backend") == "sim" ? "simulated" : "backend " + runs[0].text("backend")));
  body +=
      "<p>Counterparts of figures 5 to 10 of C. Acosta-Lúa, S. Di Gennaro and M. E. Sánchez-Morales, “An adaptive "
      "controller applied to an anti-lock braking system laboratory”, in the paper’s order and colours. The paper’s "
      "statements are paraphrased; none of its curves is traced.</p>\n<p>An exact reproduction is not possible: law "
      "and gains "
      "of the paper’s sliding-mode controller are not public, Table 1 does not fit the 1.2 s of the plots (θ = 23 N "
      "gives "
      "about 2.3 s for any controller), Q and k<sub>a1</sub> are not given, and one run of each controller shows no "
      "statistics. The page docs/paper.md of the project compares series of 200 runs.</p>\n";
  body += section("The claim", claims_table(contents));
  const auto said = words(contents);
  std::string pictures;
  for (const Picture& picture : contents.pictures) {
    const auto found = said.find(picture.figure->id);
    if (found == said.end()) continue;
    pictures += picture_html(picture);
    pictures += fmt::format("<dl class=\"says\"><dt>The paper</dt><dd>{}</dd><dt>These runs</dt><dd>{}</dd></dl>\n",
                            html_escape(found->second.paper), html_escape(found->second.ours));
  }
  body += section("Figure by figure", pictures);
  body += section("Figures of merit", metrics_table(runs, *contents.surveys));
  body += section("Differences in configuration", differences_table(runs));
  body += section("Notes", notes_list(contents.notes));
  return page_around(contents.title, contents.version, body);
}

}  // namespace abs_hil::report
