// The checks of `abs_hil doctor`, in order, and their findings as text and as JSON.
#include "diagnosis/doctor.hpp"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <thread>
#include <utility>

#include "diagnosis/machine_facts.hpp"
#include "telemetry/lcm_outlet.hpp"

namespace abs_hil::diagnosis {

namespace {

/// `text` with every line indented.
std::string indented(std::string_view text, std::string_view indent) {
  std::string out(indent);
  for (const char c : text) {
    out += c;
    if (c == '\n') out += indent;
  }
  return out;
}

/// A standing's mark in a text, and its name.
struct StandingWords {
  std::string_view mark;
  std::string_view name;
};
StandingWords words_of(Standing standing) {
  constexpr std::array<StandingWords, 4> rows{
      {{"ok  ", "ok"}, {"note", "note"}, {"WARN", "warning"}, {"FAIL", "failure"}}};
  return rows[static_cast<std::size_t>(standing)];
}

using Findings = std::vector<Finding>;

Findings machine_part(std::string_view check) {
  Findings part;
  for (Finding& finding : judge(read_machine_facts())) {
    if (finding.check == check) part.push_back(std::move(finding));
  }
  return part;
}

/// rtkit grants SCHED_RR up to priority 20 and limits the CPU time of its users. abs_hil cannot use it, but many
/// desktops have it and their users ask about it.
Finding rtkit_finding() {
  const bool there = std::filesystem::exists("/usr/libexec/rtkit-daemon");
  return {
      .check = "realtime",
      .what = there ? "rtkit is installed" : "rtkit is not installed",
      .standing = Standing::note,
      .detail = "abs_hil does not use it: it grants SCHED_RR up to priority 20 and 200 ms of CPU time, not SCHED_FIFO"};
}

Findings check_realtime(const Examination& e) {
  runtime::RealtimeOptions options = e.realtime;
  options.mode = runtime::RealtimeMode::prefer;
  runtime::RealtimeReport report;
  // Uses a thread of its own: what the thread obtains ends with it.
  std::jthread([&] { report = runtime::RealtimeScope(options).report(); }).join();
  Findings findings;
  for (const runtime::RealtimeStep& step : report.steps) {
    const Standing shortfall = step.required ? Standing::warning : Standing::note;
    findings.push_back({.check = "realtime",
                        .what = step.what,
                        .standing = step.obtained ? Standing::good : shortfall,
                        .detail = step.detail,
                        .fix = step.fix});
  }
  findings.push_back(rtkit_finding());
  return findings;
}

Findings check_lcm(const Examination& e) {
  const telemetry::RouteProbe probe = telemetry::probe_lcm_route(e.lcm_url);
  Finding finding{.check = "lcm", .what = "LCM route for " + e.lcm_url};
  if (!probe.usable) {
    finding.standing = Standing::warning;
    finding.detail = probe.problem;
    finding.fix = probe.fix + "\nor run without LCM: --no-lcm";
  }
  return {std::move(finding)};
}

Finding commissioning_finding(const Examination& e, const driver::RigDriver& driver) {
  Finding finding{.check = "backend", .what = "commissioning of the board", .detail = "its record holds"};
  try {
    e.require_commissioned(driver);
  } catch (const driver::Unavailable& error) {
    finding.standing = Standing::failure;
    finding.detail = error.what();
  }
  return finding;
}

Findings check_backend(const Examination& e) {
  Finding finding{.check = "backend", .what = "backend " + e.backend, .detail = "can run"};
  Findings findings;
  try {
    const std::unique_ptr<driver::RigDriver> driver = e.make_driver();
    driver->configure();
    if (const driver::IoResult written = driver->try_write(); !written.ok()) {
      finding.standing = Standing::failure;
      finding.detail = "it can be read, but a write that changes nothing failed: " + driver::error_text(written);
      if (written.error == driver::IoError::access_refused) {
        finding.fix = "the kernel is probably locked down: switch Secure Boot off, or boot without lockdown=";
      }
    }
    if (e.require_commissioned) findings.push_back(commissioning_finding(e, *driver));
  } catch (const driver::Unavailable& error) {
    finding.standing = Standing::failure;
    finding.detail = error.what();
  }
  findings.insert(findings.begin(), std::move(finding));
  return findings;
}

Finding judge_board(const driver::FoundBoard& board) {
  Finding f{.check = "boards", .what = board.what, .detail = board.detail};
  for (const driver::FoundBoard::Obstacle& obstacle : board.obstacles) {
    f.standing = Standing::warning;
    f.detail += (f.detail.empty() ? "" : "; ") + obstacle.what;
    f.fix += (f.fix.empty() ? "" : "\n") + obstacle.fix;
  }
  return f;
}

Findings check_boards(const Examination& e) {
  Findings findings;
  for (const driver::Backend& backend : driver::registered_backends()) {
    const driver::BoardOptions* options = e.driver.boards.find(backend.name);
    if (!backend.find || options == nullptr) continue;
    for (Finding& finding : judge(backend.name, backend.find(*options))) findings.push_back(std::move(finding));
  }
  return findings;
}

struct Check {
  std::string_view name;
  std::function<Findings(const Examination&)> make;
};

std::vector<Check> checks() {
  std::vector<Check> all{{"kernel", [](const Examination&) { return machine_part("kernel"); }},
                         {"realtime", check_realtime},
                         {"clock", [](const Examination&) { return machine_part("clock"); }},
                         {"cpu", [](const Examination&) { return machine_part("cpu"); }},
                         {"lcm", check_lcm}};
  for (const driver::Backend& backend : driver::registered_backends()) {
    if (!backend.inspect) continue;
    all.push_back({backend.name, [&backend](const Examination& e) {
                     const driver::BoardOptions* options = e.driver.boards.find(backend.name);
                     if (options == nullptr) return Findings{};
                     Findings findings = backend.inspect(*options, e.rate_Hz, e.driver.kind == backend.name);
                     for (Finding& finding : findings) finding.check = backend.name;
                     return findings;
                   }});
  }
  all.push_back({"boards", check_boards});
  all.push_back({"backend", check_backend});
  return all;
}

}  // namespace

std::string to_text(std::span<const Finding> findings) {
  std::string text;
  for (const Finding& f : findings) {
    text += fmt::format("{}  {}{}{}\n", words_of(f.standing).mark, f.what, f.detail.empty() ? "" : ": ", f.detail);
    if (!f.fix.empty()) text += fmt::format("      fix:\n{}\n", indented(f.fix, "        "));
  }
  return text;
}

nlohmann::ordered_json to_json(std::span<const Finding> findings) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Finding& f : findings) {
    list.push_back({{"check", f.check},
                    {"what", f.what},
                    {"standing", std::string(words_of(f.standing).name)},
                    {"detail", f.detail},
                    {"fix", f.fix}});
  }
  return list;
}

Standing worst(std::span<const Finding> findings) noexcept {
  Standing result = Standing::good;
  for (const Finding& f : findings) result = std::max(result, f.standing);
  return result;
}

std::vector<Finding> judge(std::string_view kind, const std::vector<driver::FoundBoard>& boards) {
  if (boards.empty()) {
    return {{.check = "boards",
             .what = "no board of driver.kind=" + std::string(kind) + " found",
             .standing = Standing::note,
             .detail = "searched by driver." + std::string(kind) + ".* (abs_hil list --keys)"}};
  }
  std::vector<Finding> findings;
  findings.reserve(boards.size());
  for (const driver::FoundBoard& board : boards) findings.push_back(judge_board(board));
  return findings;
}

std::vector<std::string> check_names() {
  std::vector<std::string> names;
  for (const Check& check : checks()) names.emplace_back(check.name);
  return names;
}

std::vector<Finding> examine(const Examination& examination) {
  Findings all;
  for (const Check& check : checks()) {
    if (!examination.only.empty() && examination.only != check.name) continue;
    for (Finding& finding : check.make(examination)) all.push_back(std::move(finding));
  }
  return all;
}

bool turned_out_well(const Examination& examination, std::span<const Finding> findings) {
  return worst(findings) < (examination.only.empty() ? Standing::failure : Standing::warning);
}

}  // namespace abs_hil::diagnosis
