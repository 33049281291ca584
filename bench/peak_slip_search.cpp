// Loss of adaptive-peak against the best constant slip, which a brute-force search finds: the whole chain in virtual
// time with real actuator and encoders. `peak_slip_search [RANDOM_RUNS [SEED]]` writes Markdown to stdout.
// "Best constant slip" is the shortest stop over a grid of references. The candidates are adaptive-actuator, which
// knows the tyre, and adaptive-peak's own slip loop with a fixed reference. A run that locks the wheel does not count.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

#include "config/config_file.hpp"
#include "config/settings.hpp"
#include "experiment/simulated_run.hpp"

namespace {

using namespace abs_hil;
using experiment::test::Setup;

constexpr double locked_slip = 0.9;
constexpr double slow_m_s = 3.0;
constexpr double grid_ratio = 1.1;

struct Braking {
  double distance_m{0.0};
  double largest_slip{0.0};  ///< above 3 m/s
};

/// Brakes the plant with a controller whose nominal parameters are `believed`.
Braking brake(const Setup& setup, const rig::RigParameters& believed) {
  Setup informed = setup;
  informed.model = believed;
  const experiment::test::Result run = experiment::test::simulated(informed);
  Braking result{.distance_m = run.metrics.stop_distance_m};
  for (const auto& record : run.records) {
    const bool counts =
        record.phase == rig::Phase::brake && setup.plant.rig.wheels.r2_m * record.truth.speeds.omega2_rad_s > slow_m_s;
    if (counts) result.largest_slip = std::max(result.largest_slip, record.truth.slip);
  }
  return result;
}

struct Best {
  double distance_m{1e9};
  double slip{0.0};
};

Best best_constant_slip(const Setup& setup) {
  Best best;
  for (double slip = 0.02; slip < 0.5; slip *= grid_ratio) {
    Setup told = setup;
    told.control.controller = "adaptive-actuator";
    told.control.slip_ref = slip;
    Setup held = setup;
    held.control.controller = "adaptive-peak";
    auto& o = held.control.adaptive_peak;
    o.slip_min = 0.999 * slip;
    o.slip_max = 1.001 * slip;
    o.slip_start = o.peak.peak_slip0 = slip;
    o.search_part = o.search_min = 0.0;
    for (const Setup& one : {told, held}) {
      const Braking run = brake(one, setup.plant.rig);
      if (run.largest_slip < locked_slip && run.distance_m < best.distance_m) best = {run.distance_m, slip};
    }
  }
  return best;
}

Setup plant(const std::string& name, const std::string& friction) {
  config::Settings s;
  config::KeyTable table(s);
  config::load_file(config::plant_file(name), table, config::Tables::of_plant);
  Setup setup = experiment::test::braking("adaptive-peak");
  setup.plant = s.plant;
  setup.plant.friction_profile = friction;
  return setup;
}

void row(const std::string& name, double distance_m, const Best& best, double largest_slip) {
  std::printf("| %s | %.2f | %.2f | %.3f | %+.1f %% | %.3f |\n", name.c_str(), distance_m, best.distance_m, best.slip,
              100.0 * (distance_m / best.distance_m - 1.0), largest_slip);
}

void named_cases() {
  std::printf(
      "| plant, road | adaptive-peak, worst of 5 seeds, m | best constant slip, m | at slip | loss | largest slip "
      "|\n|---|---|---|---|---|---|\n");
  const std::vector<std::pair<std::string, std::string>> roads{
      {"even", ""},
      {"jumps 1, 0.52, 1 at 0.8 s and 1.2 s", "braking time: 1; 0.52 at 0.8; 1 at 1.2"},
      {"jumps 0.5, 1.5, 0.8 at 0.4 s and 0.8 s", "braking time: 0.5; 1.5 at 0.4; 0.8 at 0.8"},
      {"patches of 0.5 every 2 m",
       "braking distance: 1; 0.5 at 2; 1 at 4; 0.5 at 6; 1 at 8; 0.5 at 10; 1 at 12; 0.5 at 14; 1 at 16; 0.5 at 18"}};
  for (const std::string name : {"paper-table1", "paper-timing", "inteco-manual"}) {
    for (const auto& [road, friction] : roads) {
      Setup setup = plant(name, friction);
      const Best best = best_constant_slip(setup);
      Braking worst;
      for (std::uint64_t seed = 1; seed <= 5; ++seed) {
        setup.seed = seed;
        const Braking run = brake(setup, setup.plant.rig);
        worst.distance_m = std::max(worst.distance_m, run.distance_m);
        worst.largest_slip = std::max(worst.largest_slip, run.largest_slip);
      }
      row(name + ", " + road, worst.distance_m, best, worst.largest_slip);
    }
  }
}

/// Random cases: theta 10-60 N, B 10-40, C 1.3-1.9, 60-180 rad/s; wheels and brake 10 % (radii 1 %) off the
/// controller's parameters; a friction jump and back in every second run.
void random_cases(int runs, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto draw = [&](double least, double most) {
    return least + (most - least) * static_cast<double>(random() >> 11U) * 0x1p-53;
  };
  std::vector<double> losses;
  int locked = 0;
  for (int i = 0; i < runs; ++i) {
    Setup setup = experiment::test::braking("adaptive-peak");
    const rig::RigParameters believed = setup.plant.rig;
    auto& rig = setup.plant.rig;
    auto& w = rig.wheels;
    auto& b = rig.brake;
    rig.tyre = {.theta_N = draw(10, 60), .B = draw(10, 40), .C = draw(1.3, 1.9)};
    for (double* parameter : {&w.J1_kg_m2, &w.J2_kg_m2, &w.d1_Nms_rad, &w.d2_Nms_rad, &w.M10_Nm, &w.M20_Nm, &b.b1_Nm,
                              &b.b2_Nm, &b.u0, &b.c31_per_s}) {
      *parameter *= draw(0.9, 1.1);
    }
    w.r1_m *= draw(0.99, 1.01);
    w.r2_m *= draw(0.99, 1.01);
    setup.experiment.start_speed_rad_s = draw(60, 180);
    setup.seed = random();
    const double jump = draw(10, 60) / rig.tyre.theta_N, from_s = draw(0.1, 1.2), to_s = from_s + draw(0.1, 1.0);
    if (i % 2 == 1) {
      setup.plant.friction_profile = "braking time: 1; " + std::to_string(jump) + " at " + std::to_string(from_s) +
                                     "; 1 at " + std::to_string(to_s);
    }
    const Braking run = brake(setup, believed);
    if (run.largest_slip >= locked_slip) ++locked;
    losses.push_back(run.distance_m / best_constant_slip(setup).distance_m - 1.0);
  }
  std::sort(losses.begin(), losses.end());
  const auto quantile = [&](double part) {
    return 100.0 * losses[static_cast<std::size_t>(part * static_cast<double>(losses.size() - 1))];
  };
  std::printf(
      "\n%d random runs, seed %llu: loss against the best constant slip, median %+.1f %%, 90 %% of runs below "
      "%+.1f %%, 99 %% below %+.1f %%, largest %+.1f %%; wheel locked above 3 m/s in %d runs\n",
      runs, static_cast<unsigned long long>(seed), quantile(0.5), quantile(0.9), quantile(0.99), quantile(1.0), locked);
}

}  // namespace

int main(int argc, char** argv) {
  const int runs = argc > 1 ? std::atoi(argv[1]) : 0;
  named_cases();
  if (runs > 0) random_cases(runs, argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1);
  return 0;
}
