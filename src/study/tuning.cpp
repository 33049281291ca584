#include "study/tuning.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <random>
#include <stdexcept>

#include "abs_hil/control/registry.hpp"
#include "abs_hil/rig/brake_map.hpp"
#include "config/key_table.hpp"
#include "study/parallel.hpp"

namespace abs_hil::study {

namespace {

constexpr double fault_cost = 3.0;

/// A point of the search space: each coordinate in [0, 1].
using Point = std::vector<double>;

double rounded(double value) {
  const std::string text = fmt::format("{:.3g}", value);
  double result = 0.0;
  std::from_chars(text.data(), text.data() + text.size(), result);
  return result;
}

double value_at(const rig::SearchRange& search, double coordinate) {
  if (!search.logarithmic) return rounded(search.least + coordinate * (search.most - search.least));
  return rounded(search.least * std::pow(search.most / search.least, coordinate));
}

double coordinate_of(const rig::SearchRange& search, double value) {
  const double within = std::clamp(value, search.least, search.most);
  return search.logarithmic ? std::log(within / search.least) / std::log(search.most / search.least)
                            : (within - search.least) / (search.most - search.least);
}

double& target_of(config::Settings& settings, std::string_view name) {
  const config::KeyTable table(settings);
  for (const config::Key& key : table.keys()) {
    if (key.name == name) return *std::get<double*>(key.target);
  }
  throw std::invalid_argument(fmt::format("{} is not a configuration key", name));
}

/// Uniform in [0, 1) from the generator's upper 53 bits: the same with every standard library.
double uniform(std::mt19937_64& generator) { return static_cast<double>(generator() >> 11U) * 0x1p-53; }

/// One perturbed plant of the training set.
struct Case {
  std::size_t plant{0};
  plant_sim::PlantOptions options{};
  std::uint64_t sensor_seed{0};
  double locked_distance_m{0.0};
};

/// Evaluates candidates: mean cost over the same cases for each.
class Judge {
 public:
  Judge(std::string_view controller, const TrainingSet& training, std::size_t threads)
      : keys_(tuned_keys(controller)),
        follows_slip_(follows_slip_reference(controller)),
        plants_(training.plants),
        threads_(threads) {
    if (keys_.empty())
      throw std::invalid_argument(
          fmt::format("controller {} has no gains to tune; give another controller", controller));
    if (plants_.empty() || training.cases_per_plant == 0) throw std::invalid_argument("the training set is empty");
    for (std::size_t p = 0; p < plants_.size(); ++p) {
      plants_[p].control.controller = controller;
      for (std::size_t k = 0; k < training.cases_per_plant; ++k) {
        const Perturbation perturbation = draw(training.variation, training.seed, k);
        cases_.push_back({p, perturbed(plants_[p].plant, perturbation), perturbation.sensor_seed});
      }
    }
    for_each_index(cases_.size(), threads_, [this](std::size_t i) {
      config::Settings locked = plants_[cases_[i].plant];
      locked.control.controller = "locked";
      cases_[i].locked_distance_m = simulate(locked, cases_[i].options, cases_[i].sensor_seed).metrics.stop_distance_m;
    });
  }

  [[nodiscard]] const std::vector<TunedKey>& keys() const noexcept { return keys_; }
  [[nodiscard]] Point start() {
    Point point;
    for (const TunedKey& key : keys_) point.push_back(coordinate_of(key.search, target_of(plants_.front(), key.name)));
    return point;
  }
  [[nodiscard]] std::vector<double> values(const Point& point) const {
    std::vector<double> values;
    for (std::size_t d = 0; d < keys_.size(); ++d) values.push_back(value_at(keys_[d].search, point[d]));
    return values;
  }
  /// Costs of the candidates, in their order.
  [[nodiscard]] std::vector<double> costs(const std::vector<Point>& points) {
    std::vector<double> single(points.size() * cases_.size());
    for_each_index(single.size(), threads_, [&](std::size_t index) {
      single[index] = cost(points[index / cases_.size()], cases_[index % cases_.size()]);
    });
    evaluations_ += points.size();
    std::vector<double> means(points.size(), 0.0);
    for (std::size_t i = 0; i < single.size(); ++i) means[i / cases_.size()] += single[i];
    for (double& mean : means) mean /= static_cast<double>(cases_.size());
    return means;
  }
  [[nodiscard]] std::size_t evaluations() const noexcept { return evaluations_; }

 private:
  [[nodiscard]] double cost(const Point& point, const Case& on) const {
    config::Settings candidate = plants_[on.plant];
    const std::vector<double> gains = values(point);
    for (std::size_t d = 0; d < keys_.size(); ++d) target_of(candidate, keys_[d].name) = gains[d];
    const rig::BrakeParameters& brake = candidate.plant.rig.brake;
    const double max_torque_Nm = rig::brake_torque_at(brake, candidate.gate.brake_duty_max);
    try {
      return run_cost(simulate(candidate, on.options, on.sensor_seed), follows_slip_, on.locked_distance_m,
                      max_torque_Nm);
    } catch (const std::invalid_argument&) {
      return fault_cost;  // the constructor refuses this combination of gains
    }
  }

  std::vector<TunedKey> keys_;
  bool follows_slip_;
  std::vector<config::Settings> plants_;
  std::size_t threads_;
  std::vector<Case> cases_;
  std::size_t evaluations_{0};
};

/// Trial for member `i`: moved towards the best, plus a weighted difference of two others, crossed with the member.
Point trial(const std::vector<Point>& population, std::size_t i, std::size_t best, const SearchOptions& search,
            std::mt19937_64& generator) {
  const auto other = [&] {
    return static_cast<std::size_t>(uniform(generator) * static_cast<double>(population.size()));
  };
  const Point& a = population[other()];
  const Point& b = population[other()];
  Point point = population[i];
  const auto forced = static_cast<std::size_t>(uniform(generator) * static_cast<double>(point.size()));
  for (std::size_t d = 0; d < point.size(); ++d) {
    const bool crossed = uniform(generator) < search.crossover;
    if (!crossed && d != forced) continue;
    double x = point[d] + search.weight * (population[best][d] - point[d]) + search.weight * (a[d] - b[d]);
    if (x < 0.0) x = -x;
    if (x > 1.0) x = 2.0 - x;
    point[d] = std::clamp(x, 0.0, 1.0);
  }
  return point;
}

}  // namespace

std::vector<TunedKey> tuned_keys(std::string_view controller) {
  config::Settings settings;
  const config::KeyTable table(settings);
  const std::string section = config::section_of(controller);
  std::vector<TunedKey> tuned;
  for (const config::Key& key : table.keys()) {
    if (key.search.given() && key.name.starts_with(section)) tuned.push_back({key.name, key.search});
  }
  return tuned;
}

bool follows_slip_reference(std::string_view controller) noexcept { return controller != "five-phase"; }

std::vector<std::string_view> tunable_controllers() {
  std::vector<std::string_view> names;
  for (const control::ControllerEntry& entry : control::controllers()) {
    if (!tuned_keys(entry.name).empty()) names.push_back(entry.name);
  }
  return names;
}

double run_cost(const RunResult& run, bool follows_slip, double locked_distance_m, double max_torque_Nm) noexcept {
  const analysis::Metrics& m = run.metrics;
  double cost = m.stop_distance_m / locked_distance_m + 0.5 * m.time_locked_s +
                1e-4 * m.torque_total_variation_Nm / max_torque_Nm;
  if (follows_slip) cost += 2.0 * m.slip_rms + 0.2 * m.slip_overshoot;
  return run.stopped() && std::isfinite(cost) ? cost : fault_cost;
}

TuningResult tune(std::string_view controller, const TrainingSet& training, const SearchOptions& search,
                  const std::function<void(std::size_t, double)>& progress) {
  Judge judge(controller, training, search.threads);
  const std::size_t dimensions = judge.keys().size();
  const std::size_t size = search.population > 0 ? search.population : std::clamp<std::size_t>(8 * dimensions, 16, 40);
  std::mt19937_64 generator(search.seed);

  // The present gains are not part of the first generation: the search must not depend on them.
  TuningResult result{.start_cost = judge.costs({judge.start()}).front()};
  std::vector<Point> population(size, Point(dimensions));
  for (Point& point : population) {
    for (double& coordinate : point) coordinate = uniform(generator);
  }
  std::vector<double> costs = judge.costs(population);
  const auto best = [&costs] {
    return static_cast<std::size_t>(std::min_element(costs.begin(), costs.end()) - costs.begin());
  };
  for (std::size_t generation = 1; generation <= search.generations; ++generation) {
    std::vector<Point> trials;
    for (std::size_t i = 0; i < size; ++i) trials.push_back(trial(population, i, best(), search, generator));
    const std::vector<double> trial_costs = judge.costs(trials);
    for (std::size_t i = 0; i < size; ++i) {
      if (trial_costs[i] > costs[i]) continue;
      population[i] = trials[i];
      costs[i] = trial_costs[i];
    }
    if (progress) progress(generation, costs[best()]);
  }
  result.values = judge.values(population[best()]);
  result.cost = costs[best()];
  result.evaluations = judge.evaluations();
  return result;
}

std::string to_toml(std::string_view controller, const TuningResult& result, std::string_view comment) {
  const std::vector<TunedKey> keys = tuned_keys(controller);
  const std::string table = keys.front().name.substr(0, keys.front().name.rfind('.'));
  std::string text = fmt::format("# {}\n", comment);
  text += fmt::format("# Mean cost {:.5f} after {} candidates.\n", result.cost, result.evaluations);
  text += fmt::format("description = \"Gains of {} found by abs_tune\"\n\n[{}]\n", controller, table);
  for (std::size_t d = 0; d < keys.size(); ++d) {
    const std::string number = fmt::format("{}", result.values[d]);
    const bool whole = number.find_first_of(".e") == std::string::npos;
    text += fmt::format("{} = {}{}\n", keys[d].name.substr(table.size() + 1), number, whole ? ".0" : "");
  }
  return text;
}

}  // namespace abs_hil::study
