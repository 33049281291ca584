// `abs_hil doctor`: what this computer and the boards at it can do.
#include "diagnosis/doctor.hpp"

#include <fmt/format.h>

#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>

#include "config/board_policy.hpp"
#include "config/config_file.hpp"
#include "driver/factory.hpp"
#include "experiment/board_record.hpp"
#include "guardian/guardian_lease.hpp"
#include "program/subcommands.hpp"
#include "run/run.hpp"
#include "telemetry/lcm_url.hpp"

namespace abs_hil::program {

namespace {

/// Who has the outputs, as the resident service says.
diagnosis::Finding service_finding(const std::string& socket) {
  diagnosis::Finding finding{
      .check = "boards", .what = "resident guardian at " + socket, .standing = diagnosis::Standing::note};
  const auto service = guardian::service_state(socket);
  if (!service) {
    finding.detail = "none listens: each run starts its own (docs/dead-man.md)";
  } else if (service->service == 0) {
    finding.standing = diagnosis::Standing::warning;
    finding.detail = "cannot be asked: " + service->text;
  } else {
    finding.detail = fmt::format("process {} keeps {}", service->service, service->text);
  }
  return finding;
}

/// Runs all checks of this computer or the named one, and prints a fix for each shortcoming.
int doctor(const config::Settings& s, const std::string& only, bool json) {
  std::unique_ptr<guardian::GuardianLease> lease;
  diagnosis::Examination examination{.only = only,
                                     .lcm_url = telemetry::default_lcm_url(),
                                     .realtime = s.realtime,
                                     .backend = s.backend,
                                     .rate_Hz = s.control.rate_Hz,
                                     .driver = s.driver,
                                     .make_driver = [&] {
                                       // The resident service lets go of the board for the holder of its lease.
                                       lease = guardian::ask_for_lease(s, false);
                                       return run::make_driver(s);
                                     }};
  if (s.on_rig() && config::is_real_board(s.driver)) {
    examination.require_commissioned = [&s](const driver::RigDriver& driver) {
      static_cast<void>(experiment::require_record(s.driver, s.rig, driver.identity()));
    };
  }
  std::vector<diagnosis::Finding> findings = diagnosis::examine(examination);
  if (const std::string note = driver::verification_note(s.driver);
      !note.empty() && (only.empty() || only == "boards")) {
    findings.push_back({.check = "boards", .what = note, .standing = diagnosis::Standing::note});
  }
  if (only.empty() || only == "boards") findings.push_back(service_finding(s.guardian.socket));
  if (s.on_rig() && (only.empty() || only == "backend")) {
    const auto today = std::chrono::floor<std::chrono::days>(std::chrono::system_clock::now());
    findings.push_back(
        {.check = "backend", .what = config::model_origin(s, today), .standing = diagnosis::Standing::note});
  }
  const bool well = diagnosis::turned_out_well(examination, findings);
  if (json) {
    const nlohmann::ordered_json report{
        {"backend", s.backend}, {"well", well}, {"findings", diagnosis::to_json(findings)}};
    // Facts of the computer, as an environment variable, may hold any bytes.
    constexpr auto any_bytes = nlohmann::ordered_json::error_handler_t::replace;
    fmt::print("{}\n", report.dump(2, ' ', false, any_bytes));
  } else {
    fmt::print("{}", diagnosis::to_text(findings));
  }
  return well ? exit_completed : exit_unavailable;
}

struct DoctorOptions {
  config::Sources sources{};
  std::string only{};
  bool json{false};
};

}  // namespace

Action add_doctor(cli::Parser& parser, const Words&) {
  const auto o = std::make_shared<DoctorOptions>();
  add_backend_option(parser, o->sources);
  add_configuration_options(parser, o->sources);
  parser.add("--only", &o->only, "run only this check", {.one_of = diagnosis::check_names()});
  parser.add("--json", &o->json, "print JSON instead of text");
  return [o] { return doctor(config::merged_settings(o->sources), o->only, o->json); };
}

}  // namespace abs_hil::program
