// The tyres' curves against published coefficients in 40-digit arithmetic.
#include "abs_hil/plant_sim/tyre_models.hpp"

#include <cmath>
#include <stdexcept>

#include "catch.hpp"
#include "rigs.hpp"

using namespace abs_hil::plant_sim;
using Catch::Matchers::Contains;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

TEST_CASE("The maker's curve has the values that 40-digit arithmetic gives for the published coefficients") {
  const IntecoMu tyre(inteco_manual());
  const auto [slip, mu] = GENERATE(table<double, double>({{0.001, 0.0007512596304814},
                                                          {0.01, 0.0798280821634564},
                                                          {0.02, 0.2077867980751990},
                                                          {0.05, 0.3550089400290882},
                                                          {0.10, 0.3896816981205186},
                                                          {0.15, 0.3948472925401165},
                                                          {0.20, 0.3953814736202604},
                                                          {0.50, 0.3893643397373594},
                                                          {1.00, 0.3992043980505987}}));
  CHECK_THAT(tyre.peak_mu() * tyre.shape(slip), WithinAbs(mu, 1e-15));
  CHECK(tyre.shape(-slip) == -tyre.shape(slip));
}

TEST_CASE("The peak is found at any position") {
  CHECK_THAT(IntecoMu(inteco_manual()).peak_mu(), WithinAbs(0.3992043980505987, 1e-15));  // a locked wheel
  PlantOptions options = inteco_manual();
  options.inteco_mu.w3 = 0.0;  // the curve falls after its knee
  const IntecoMu falling(options);
  double highest = 0.0;
  for (int i = 1; i <= 1'000'000; ++i) highest = std::max(highest, falling.peak_mu() * falling.shape(1e-6 * i));
  CHECK_THAT(falling.peak_mu(), WithinAbs(highest, 1e-12));
  CHECK(falling.shape(1.0) < 0.95);
}

TEST_CASE("The maker's slip: braking, traction, 1 for opposite directions, mirrored backward, 0 at rest") {
  const IntecoMu tyre(inteco_manual());
  CHECK_THAT(tyre.slip(6.0, 10.0), WithinAbs(0.4, 1e-15));   // (v_x - v_w) / v_x
  CHECK_THAT(tyre.slip(10.0, 6.0), WithinAbs(-0.4, 1e-15));  // s (v_w - v_x) / v_w; (5) would give -0.667
  CHECK_THAT(tyre.slip(-6.0, -10.0), WithinAbs(-0.4, 1e-15));
  CHECK(tyre.slip(-3.0, 10.0) == 1.0);
  CHECK(tyre.slip(3.0, -10.0) == -1.0);
  CHECK(tyre.slip(10.0, -3.0) == -1.0);
  CHECK(tyre.slip(0.0, 10.0) == 1.0);
  CHECK(tyre.slip(10.0, 0.0) == -1.0);
  CHECK(tyre.slip(0.0, 0.0) == 0.0);
  CHECK_THAT(tyre.slip(0.004, 0.005), WithinAbs(0.001 / 0.02, 1e-15));  // regularised
  // The paper's slip for the same speeds.
  const MagicFormula paper{PlantOptions{}};
  CHECK_THAT(paper.slip(10.0, 6.0), WithinAbs(-4.0 / 6.0, 1e-15));
  CHECK_THAT(paper.slip(0.004, 0.005), WithinAbs(0.001 / 0.02, 1e-15));
}

TEST_CASE("Friction is 0 where the published polynomial would drive") {
  const IntecoMu tyre(inteco_manual());
  CHECK(tyre.shape(3e-5) == 0.0);
  CHECK(tyre.shape(-3e-5) == 0.0);
  CHECK(tyre.shape(1e-4) > 0.0);
}

TEST_CASE("No tyre rises more steeply than its bound, and the bound is nearly reached") {
  PlantOptions options = inteco_manual();
  options.tyre = GENERATE("magic-formula", "inteco-mu");
  options.friction_fall_s_m = GENERATE(0.0, 0.02);
  const TyreModel model = make_tyre_model(options);
  const double v_x = GENERATE(16.8, 1.0, 0.005);
  INFO(options.tyre << " at " << v_x << " m/s");
  std::visit(
      [&](const auto& tyre) {
        const auto shape = [&](double v_w) { return tyre.shape_at(v_w, v_x); };
        double share = 0.0;
        for (int i = -4000; i <= 8000; ++i) {
          const double v_w = v_x * i / 4000.0;
          const double h = 1e-6 * v_x;
          const double slope = (shape(v_w - h) - shape(v_w + h)) / (2.0 * h);
          share = std::max(share, slope / tyre.steepest_s_m(v_w, v_x));
        }
        CHECK(share <= 1.0 + 1e-6);
        CHECK(share > 0.9);
      },
      model);
}

TEST_CASE("Friction falls with the sliding speed, down to none") {
  PlantOptions options = inteco_manual();
  options.tyre = GENERATE("magic-formula", "inteco-mu");
  options.friction_fall_s_m = 0.05;
  std::visit(
      [](const auto& tyre) {
        CHECK_THAT(tyre.shape_at(4.0, 10.0), WithinRel(0.7 * tyre.shape(tyre.slip(4.0, 10.0)), 1e-12));
        CHECK_THAT(tyre.shape_at(10.0, 4.0), WithinRel(0.7 * tyre.shape(tyre.slip(10.0, 4.0)), 1e-12));
        CHECK(tyre.shape_at(-15.0, 10.0) == 0.0);
      },
      make_tyre_model(options));
}

TEST_CASE("A curve that is nowhere positive and an unknown tyre are refused") {
  PlantOptions options = inteco_manual();
  options.inteco_mu.w4 = -1.0;
  CHECK_THROWS_WITH(Plant(options), Contains("plant.mu_w4 = -1") && Contains("nowhere positive"));
  options = {};
  options.tyre = "pacejka";
  CHECK_THROWS_WITH(Plant(options),
                    Contains("plant.tyre = \"pacejka\" is not valid; give one of magic-formula, inteco-mu"));
}
