#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <exception>
#include <filesystem>
#include <string>
#include <vector>

#include "analysis/result_file.hpp"
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

int run(int argc, char** argv) {
  CLI::App cli{"Searches for a controller's gains in simulation and writes them as a configuration file"};
  cli.name("abs_tune");
  Options o;
  cli.add_option("--controllers", o.controllers, "controllers to tune (default: all that have gains)")->delimiter(',');
  cli.add_option("--plants", o.plants, "plants to tune on")->delimiter(',')->capture_default_str();
  cli.add_option("--model", o.model, "the controllers' model, by name or TOML file (default: each plant)");
  cli.add_option("--folder", o.folder, "existing folder for CONTROLLER.toml")->required();
  cli.add_option("--cases", o.cases, "varied plants for each plant")->check(CLI::Range(1, 1000))->capture_default_str();
  cli.add_option("--generations", o.search.generations, "generations of the search")
      ->check(CLI::Range(1, 10'000))
      ->capture_default_str();
  cli.add_option("--seed", o.search.seed, "seed of the search")->capture_default_str();
  o.search.threads = study::machine_threads();
  cli.add_option("--threads", o.search.threads, "number of threads; does not change the results")
      ->check(CLI::Range(1, 1024));
  try {
    cli.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return cli.exit(error);  // --help
    fmt::print(stderr, "abs_tune: {} (abs_tune --help shows all options)\n", error.what());
    return 2;
  }
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
