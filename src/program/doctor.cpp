#include "diagnosis/doctor.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "driver/factory.hpp"
#include "experiment/board_record.hpp"
#include "program/exit_status.hpp"
#include "program/run_parts.hpp"
#include "program/subcommands.hpp"
#include "runtime/board_policy.hpp"
#include "telemetry/lcm_url.hpp"

namespace abs_hil::program {

int doctor(const RunRequest& request, const std::string& only, bool json) {
  const config::Settings& s = request.settings;
  diagnosis::Examination examination{.only = only,
                                     .lcm_url = telemetry::default_lcm_url(),
                                     .realtime = s.realtime,
                                     .backend = s.backend,
                                     .rate_Hz = s.control.rate_Hz,
                                     .driver = s.driver,
                                     .make_driver = [&s] { return make_driver(s, false); }};
  if (s.on_rig() && runtime::is_real_board(s.driver)) {
    examination.require_commissioned = [&s](const driver::RigDriver& driver) {
      experiment::require_record(s.driver, driver.identity());
    };
  }
  std::vector<diagnosis::Finding> findings = diagnosis::examine(examination);
  if (const std::string note = driver::verification_note(s.driver);
      !note.empty() && (only.empty() || only == "boards")) {
    findings.push_back({.check = "boards", .what = note, .standing = diagnosis::Standing::note});
  }
  const bool well = diagnosis::turned_out_well(examination, findings);
  if (json) {
    const nlohmann::ordered_json report{
        {"backend", s.backend}, {"well", well}, {"findings", diagnosis::to_json(findings)}};
    fmt::print("{}\n", report.dump(2));
  } else {
    fmt::print("{}", diagnosis::to_text(findings));
  }
  return well ? exit_completed : exit_unavailable;
}

}  // namespace abs_hil::program
