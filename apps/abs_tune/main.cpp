#include <fmt/format.h>

#include <exception>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "analysis/result_file.hpp"
#include "cli/command_line.hpp"
#include "config/config_error.hpp"
#include "config/config_file.hpp"
#include "config/key_table.hpp"
#include "study/parallel.hpp"
#include "study/tuning.hpp"

namespace {

using namespace abs_hil;

/// The paper brakes from 1625 rpm, 170 rad/s.
constexpr double start_speed_rad_s = 170.0;

struct Options {
  std::vector<std::string> controllers{};
  std::vector<std::string> plants{"paper-table1", "paper-timing"};
  std::string model{};
  std::string folder{};
  std::size_t cases{6};
  study::SearchOptions search{};
};

study::TrainingSet training_set(const Options& o) {
  study::TrainingSet training{.cases_per_plant = o.cases};
  for (const std::string& plant : o.plants) {
    config::Settings& s = training.plants.emplace_back();
    config::KeyTable keys(s);
    s.plant_name = plant;
    config::load_file(config::plant_file(plant), keys, config::Tables::of_plant);
    if (!o.model.empty()) config::set_all(config::read_model(config::plant_file(o.model, "--model")), keys);
    s.experiment.start_speed_rad_s = start_speed_rad_s;
  }
  return training;
}

void tune(const std::string& controller, const Options& o) {
  const std::filesystem::path path = std::filesystem::path(o.folder) / (controller + ".toml");
  analysis::ResultFile file(path, "the gains");
  const auto result = study::tune(controller, training_set(o), o.search, [&](std::size_t generation, double cost) {
    fmt::print(stderr, "{}: generation {} of {}, cost {:.5f}\n", controller, generation, o.search.generations, cost);
  });
  const std::string comment =
      fmt::format("abs_tune --controllers {} --plants {}{} --cases {} --generations {} --seed {} (docs/comparison.md)",
                  controller, fmt::join(o.plants, ","), o.model.empty() ? "" : " --model " + o.model, o.cases,
                  o.search.generations, o.search.seed);
  const std::string text = study::to_toml(controller, result, comment);
  file.write(text);
  fmt::print("{}: cost {:.5f}, with the previous gains {:.5f}\n{}\n", controller, result.cost, result.start_cost, text);
}

void add_options(cli::Parser& parser, Options& o) {
  parser.add({.names = "--controllers",
              .to = &o.controllers,
              .help = "controllers to tune (default: all that have gains)",
              .delimiter = ','});
  parser.add(
      {.names = "--plants", .to = &o.plants, .help = "plants to tune on", .delimiter = ',', .show_default = true});
  parser.add({.names = "--model",
              .to = &o.model,
              .help = "the controllers' model, by name or TOML file (default: each plant)"});
  parser.add({.names = "--folder", .to = &o.folder, .help = "existing folder for CONTROLLER.toml", .required = true});
  parser.add({.names = "--cases",
              .to = &o.cases,
              .help = "varied plants for each plant",
              .range = {1, 1000},
              .show_default = true});
  parser.add({.names = "--generations",
              .to = &o.search.generations,
              .help = "generations of the search",
              .range = {1, 10'000},
              .show_default = true});
  parser.add({.names = "--seed", .to = &o.search.seed, .help = "seed of the search", .show_default = true});
  parser.add({.names = "--threads",
              .to = &o.search.threads,
              .help = "number of threads; does not change the results",
              .range = {1, 1024}});
}

int run(int argc, char** argv) {
  cli::Parser parser("abs_tune",
                     "Searches for a controller's gains in simulation and writes them as a configuration file");
  Options o;
  o.search.threads = study::machine_threads();
  add_options(parser, o);
  if (const std::optional<int> status = parser.parse(argc, argv)) return *status;
  if (o.controllers.empty()) {
    for (const std::string_view name : study::tunable_controllers()) o.controllers.emplace_back(name);
  }
  for (const std::string& controller : o.controllers) tune(controller, o);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    fprintf(stderr, "abs_tune: %s\n", error.what());
    return 2;
  }
}
