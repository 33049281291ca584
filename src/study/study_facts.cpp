#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "config/key_table.hpp"
#include "run_folder/environment.hpp"
#include "run_folder/run_folder.hpp"
#include "study/result_rows.hpp"
#include "study/study_folder.hpp"

namespace abs_hil::study {

namespace {

/// The whole configuration of every case and controller: files that the study names count with their content.
nlohmann::ordered_json configurations_of(const Study& study) {
  nlohmann::ordered_json all = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < study.cases().size(); ++i) {
    const StudyCase& one = study.cases()[i];
    nlohmann::ordered_json controllers = nlohmann::ordered_json::object();
    for (const Contender& contender : study.contenders(i)) {
      config::Settings settings = contender.settings;
      nlohmann::ordered_json config = config::KeyTable(settings).to_json();
      // What a simulated run in this process does not depend on.
      for (const char* table : {"driver", "guardian", "commands", "realtime", "telemetry", "unsafe"}) {
        config.erase(table);
      }
      controllers[contender.name] = std::move(config);
    }
    all.push_back({{"plant", one.plant}, {"experiment", one.experiment}, {"controllers", std::move(controllers)}});
  }
  return all;
}

}  // namespace

std::uint64_t StudyFacts::runs_in(std::uint64_t number) const noexcept {
  return std::min(chunk, runs - number * chunk);
}

StudyFacts facts_of(const Study& study, const std::string& name) {
  const run_folder::BuildFacts build = run_folder::build_facts();
  StudyFacts facts{.program = fmt::format("abs_hil {} ({})", build.version, build.git_revision),
                   .name = name,
                   .text = study.script().text,
                   .runs = study.runs(),
                   .chunk = study.script().chunk,
                   .columns = result_columns(study),
                   .configurations = configurations_of(study).dump()};
  facts.identity = run_folder::sha256_of(fmt::format("{}\n{}\n{}\n", facts.program, facts.text, facts.configurations));
  return facts;
}

}  // namespace abs_hil::study
