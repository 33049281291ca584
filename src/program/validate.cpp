// Files that people write: `abs_hil validate`, an experiment in words, checked against the limits of its backend, and
// `abs_hil init-rig`, a plant's file to fill in for a rig of one's own.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>

#include "abs_hil/plant_sim/plant.hpp"
#include "config/config_error.hpp"
#include "config/merge.hpp"
#include "config/plan.hpp"
#include "files/result_file.hpp"
#include "program/subcommands.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::program {

namespace {

/// @param safety  say first what the run may do on a board; refuse what needs a person's consent, in its series, too
int validate(const config::Sources& sources, bool safety) {
  if (safety) {
    const config::SafetyView view = config::safety_view(sources);
    cli::print("{}\n", config::in_words(view));
    static_cast<void>(config::refuse_weak_rows(view));
  }
  const config::Configuration merged = config::merge(sources);
  const config::Script& script = *merged.script;
  const config::Settings& s = merged.settings;
  if (safety && script.series.given) {
    for (const config::SeriesMember& member : config::members_of(script, s.seed)) {
      config::Sources one = sources;
      config::choose(member, one);
      static_cast<void>(config::refuse_weak_rows(config::safety_view(one)));
    }
  }
  cli::print("{}", config::explain(script, s));
  if (!script.series.experiments.empty()) {
    int status = exit_completed;
    for (const std::string& name : script.series.experiments) {
      cli::print("\n");
      config::Sources one = sources;
      one.experiment = name;
      config::refuse_nested(script, *config::find(*one.experiment));
      status = std::max(status, validate(one, safety));
    }
    return status;
  }
  const config::Plan plan = config::plan(script, s);
  std::vector<std::string> problems = config::beyond_limits(plan, s);
  for (std::string& problem : problems) problem += "; give at most that in this phase, or raise the limit";
  std::ranges::move(config::certain_faults(plan, s), std::back_inserter(problems));
  for (const std::string& problem : problems) cli::print(stderr, "abs_hil: {}: {}\n", script.path, problem);
  if (!problems.empty()) return exit_usage;
  // Find errors that appear only when a run is made.
  static_cast<void>(experiment::Sequence(plan.phases, plan.limits));
  if (s.backend == "sim") static_cast<void>(plant_sim::Plant(s.plant));
  const std::string model = config::in_words(config::model_differences(s));
  if (!s.on_rig() && !model.empty()) cli::print("The model differs from the plant: {}.\n", model);
  cli::print(
      "The experiment is within the limits of backend {}, {} {}.{}\n", s.backend, s.on_rig() ? "model" : "plant",
      s.plant_name,
      script.events.empty() ? "" : " It has events, which only a simulation can carry out: --backend rig refuses it.");
  return exit_completed;
}

int init_rig(const config::Settings& settings, const std::string& name) {
  if (name.empty() || rig::plain_name(name, "-_") != name) {
    throw config::ConfigError(fmt::format("init-rig: \"{}\": give a name of letters, digits, - and _", name));
  }
  const std::filesystem::path file = name + ".toml";
  std::error_code ignored;
  if (std::filesystem::exists(std::filesystem::symlink_status(file, ignored))) {
    throw config::ConfigError(
        fmt::format("init-rig: {} exists already; give another name or move it away", file.string()));
  }
  try {
    files::write_result(file, "model file", config::rig_file(settings, name));
  } catch (const files::FileError& error) {
    throw config::ConfigError(std::string("init-rig: ") + error.what());
  }
  cli::print(
      "{0}: fill in the values of your rig. Then: abs_hil --plant {0}, abs_hil commission --set rig.identity={0}, "
      "abs_hil --backend rig --set rig.identity={0} --model {0}\n",
      file.string());
  return exit_completed;
}

}  // namespace

Action add_validate(cli::Parser& parser, const Words&) {
  const auto o = std::make_shared<config::Sources>();
  const auto schema = std::make_shared<bool>(false);
  const auto safety = std::make_shared<bool>(false);
  parser.add("EXPERIMENT", &o->experiment, "experiment by name or TOML file", {.type = "NAME|FILE"});
  parser.add("--safety", safety.get(),
             "print all that the run may do on a board, and what needs a person's consent there");
  parser.add("--schema", schema.get(), "print the JSON Schema of experiment files instead");
  add_backend_option(parser, *o);
  add_configuration_options(parser, *o);
  return [o, schema, safety] {
    if (*safety) o->backend = "rig";
    if (!*schema) return validate(*o, *safety);
    cli::print("{}\n", config::schema().dump(2));
    return int{exit_completed};
  };
}

Action add_init_rig(cli::Parser& parser, const Words&) {
  const auto o = std::make_shared<config::Sources>();
  const auto name = std::make_shared<std::string>();
  parser.add("name", name.get(), "name of the rig", {.type = "NAME", .required = true});
  parser.add("--plant", &o->plant, "plant whose values it begins with, by name or TOML file", {.type = "NAME|FILE"});
  return [o, name] { return init_rig(config::merged_settings(*o), *name); };
}

}  // namespace abs_hil::program
