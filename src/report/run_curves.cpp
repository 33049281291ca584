#include "report/run_curves.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "report/csv_reader.hpp"

namespace abs_hil::report {

namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

struct Collector {
  const Request* request;
  std::size_t column;
  std::size_t minus;
  bool subtracts;
  Decimation decimation;
  Range relevant{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
};

}  // namespace

std::map<std::string, Profile> read_curves(const RunFiles& run, const RunSurvey& survey,
                                           const std::vector<Request>& requests, std::size_t most_stretches) {
  CsvReader csv(run.csv);
  std::vector<Collector> collectors;
  for (const Request& request : requests) {
    const bool subtracts = !request.minus.empty();
    const std::size_t column = csv.column(request.column);
    collectors.push_back(
        {&request, column, subtracts ? csv.column(request.minus) : column, subtracts, Decimation(most_stretches)});
  }
  const std::size_t speed = csv.column(survey.knows("omega2_rad_s") ? "omega2_rad_s" : "omega2_est_rad_s");
  while (csv.next()) {
    const double time_s = csv.time_s();
    const bool braking = csv.phase() == "brake";
    const bool relevant = braking && survey.r2_m * csv.values()[speed] > analysis::least_judged_speed_m_s;
    for (Collector& c : collectors) {
      if (time_s < c.request->window.from_s || time_s > c.request->window.to_s) continue;
      double value = csv.values()[c.column];
      if (c.subtracts) value -= csv.values()[c.minus];
      if (c.request->braking_only && !braking) value = unknown;
      c.decimation.add(time_s - c.request->window.zero_s, value);
      if (relevant && std::isfinite(value)) {
        c.relevant = {std::min(c.relevant.first, value), std::max(c.relevant.second, value)};
      }
    }
  }
  std::map<std::string, Profile> curves;
  for (const Collector& c : collectors) curves[c.request->name] = {c.decimation.points(), c.relevant};
  return curves;
}

}  // namespace abs_hil::report
