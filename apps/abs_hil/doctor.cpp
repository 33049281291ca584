#include <fmt/format.h>

#include <thread>

#include "abs_hil/runtime/realtime_setup.hpp"
#include "abs_hil/telemetry/lcm_url.hpp"
#include "abs_hil/telemetry/route_probe.hpp"
#include "commands.hpp"
#include "exit_status.hpp"

namespace abs_hil::app {

namespace {

bool report(bool good, const std::string& what, const std::string& problem, const std::string& fix) {
  fmt::print("{}  {}\n", good ? "ok  " : "FAIL", what);
  if (!good) fmt::print("      {}\n      to mend it:\n{}\n", problem, fix);
  return good;
}

bool check_lcm() {
  const std::string url = telemetry::default_lcm_url();
  const telemetry::RouteProbe probe = telemetry::probe_lcm_route(url);
  return report(probe.usable, "LCM route for " + url, probe.problem, probe.fix);
}

bool check_realtime() {
  // In a thread of its own: what is obtained is obtained for good.
  runtime::RealtimeReport result;
  std::jthread([&result] { result = runtime::set_up_realtime({}); }).join();
  bool good = true;
  for (const auto& step : result.steps)
    good = report(step.obtained, step.what, step.detail, "      " + step.fix) && good;
  return good;
}

}  // namespace

std::vector<std::string> doctor_checks() { return {"lcm", "realtime"}; }

int doctor(const std::string& only) {
  bool good = true;
  if (only.empty() || only == "lcm") good = check_lcm() && good;
  if (only.empty() || only == "realtime") good = check_realtime() && good;
  return good ? exit_completed : exit_unavailable;
}

}  // namespace abs_hil::app
