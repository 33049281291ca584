#include <fmt/format.h>

#include "abs_hil/script/explain.hpp"
#include "abs_hil/script/library.hpp"
#include "abs_hil/script/plan.hpp"
#include "commands.hpp"
#include "exit_status.hpp"

namespace abs_hil::app {

int validate(const RunRequest& request) {
  const script::Script& script = *request.script;
  fmt::print("{}", script::explain(script, request.settings));
  const std::vector<std::string> problems =
      script::beyond_limits(script::plan(script, request.settings), request.settings);
  for (const std::string& problem : problems) fmt::print(stderr, "abs_hil: {}: {}\n", script.path, problem);
  if (!problems.empty()) return exit_usage;
  fmt::print("Within the limits of backend {}, plant {}.{}\n", request.settings.backend, request.settings.plant_name,
             script.events.empty() ? "" : " Its events happen in simulation only: --backend rig refuses it.");
  return exit_completed;
}

int print_schema() {
  fmt::print("{}\n", script::schema().dump(2));
  return exit_completed;
}

}  // namespace abs_hil::app
