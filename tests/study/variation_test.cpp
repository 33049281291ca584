// Variations of the plant: their text, ranges and random numbers.
#include "study/variation.hpp"

#include <cmath>
#include <set>
#include <vector>

#include "catch.hpp"

using namespace abs_hil;
using namespace abs_hil::study;
using Catch::Matchers::Contains;
using Catch::Matchers::WithinRel;

TEST_CASE("a specification reads back as it was written") {
  for (const char* text : {"none", "phase", "theta=0.2", "parameters=0.1,theta=0.1,phase", "wheels=0.05,tyre=0.25",
                           "brake=0.5,radii=0.01,phase", "measured", "theta=0.1,phase,measured"}) {
    INFO(text);
    CHECK(Variation::parse(text).text() == text);
  }
  CHECK(Variation::parse("parameters=0.1,theta=0.1,phase") == Variation::standard());
  CHECK(Variation::parse("parameters=0.1").wheels == 0.1);
  CHECK(Variation::parse("parameters=0.1").theta == 0.0);
}

TEST_CASE("an invalid specification is refused by name and range") {
  CHECK_THROWS_WITH(Variation::parse("thetta=0.1"), Contains("thetta") && Contains("parameters"));
  CHECK_THROWS_WITH(Variation::parse("theta=0.6"), Contains("theta=0.6") && Contains("[0, 0.5]"));
  CHECK_THROWS_WITH(Variation::parse("theta=-0.1"), Contains("theta=-0.1"));
  CHECK_THROWS_WITH(Variation::parse("theta=nan"), Contains("theta=nan"));
  CHECK_THROWS_WITH(Variation::parse("theta"), Contains("magnitude"));
  CHECK_THROWS_WITH(Variation::parse("theta=0.1,"), Contains("is unknown"));
  CHECK_THROWS_WITH(Variation::parse(""), Contains("is unknown"));
  CHECK_THROWS_WITH(Variation::parse("phase=1"), Contains("phase=1"));
}

TEST_CASE("factors lie within their range, fill it, and differ from each other") {
  const Variation variation{.wheels = 0.1, .brake = 0.2, .tyre = 0.3, .theta = 0.4, .radii = 0.01, .phase = true};
  double least = 1.0;
  double most = 1.0;
  std::set<double> values;
  for (std::uint64_t k = 0; k < 500; ++k) {
    const Perturbation p = draw(variation, 7, k);
    for (const double f : {p.J1, p.J2, p.d1, p.d2, p.M10, p.M20}) {
      CHECK((f >= 0.9 && f < 1.1));
      values.insert(f);
    }
    for (const double f : {p.brake_gain, p.u0, p.c31}) CHECK((f >= 0.8 && f < 1.2));
    for (const double f : {p.B, p.C}) CHECK((f >= 0.7 && f < 1.3));
    for (const double f : {p.r1, p.r2}) CHECK((f >= 0.99 && f < 1.01));
    CHECK((p.theta >= 0.6 && p.theta < 1.4));
    least = std::min(least, p.theta);
    most = std::max(most, p.theta);
  }
  CHECK(least < 0.61);
  CHECK(most > 1.39);
  CHECK(values.size() == 3000);
}

TEST_CASE("a perturbation depends on seed and number alone, and no parameter depends on what else varies") {
  const Perturbation all = draw(Variation::standard(), 3, 17);
  CHECK(draw(Variation::standard(), 3, 17) == all);
  CHECK_FALSE(draw(Variation::standard(), 3, 18) == all);
  CHECK_FALSE(draw(Variation::standard(), 4, 17) == all);
  CHECK_FALSE(draw(Variation::standard(), 3ULL + (1ULL << 32U), 17) == all);
  const Perturbation theta_only = draw(Variation::parse("theta=0.1"), 3, 17);
  CHECK(theta_only.theta == all.theta);
  CHECK(theta_only.J1 == 1.0);
  CHECK(draw(Variation::parse("phase"), 3, 17).sensor_seed == all.sensor_seed);
  CHECK(theta_only.sensor_seed == draw({}, 99, 0).sensor_seed);
}

TEST_CASE("a rig as measured takes the place of any nominal plant, and the other entries scale it") {
  plant_sim::PlantOptions one;
  plant_sim::PlantOptions other;
  other.tyre = "inteco-mu";
  other.inteco_mu.w4 = 0.1;
  other.rig.brake.c31_per_s = 3.0;
  other.brake_flaws.hysteresis = 0.2;
  other.rig.encoder_counts_per_rev = one.rig.encoder_counts_per_rev = 1024;  // no matter of the session
  const Perturbation drawn = draw(Variation::parse("measured,phase"), 3, 5);
  plant_sim::PlantOptions from_one = perturbed(one, drawn);
  const plant_sim::PlantOptions from_other = perturbed(other, drawn);
  CHECK(from_one.rig.brake == from_other.rig.brake);
  CHECK(from_one.rig.wheels == from_other.rig.wheels);
  CHECK(from_one.rig.motor == from_other.rig.motor);
  CHECK(from_one.brake_flaws == from_other.brake_flaws);
  CHECK(from_one.inteco_mu.w1 == from_other.inteco_mu.w1);
  CHECK(from_one.inteco_mu.w4 == from_other.inteco_mu.w4);
  CHECK(from_other.rig.encoder_counts_per_rev == 1024);
  CHECK_FALSE(perturbed(one, draw(Variation::parse("measured"), 3, 6)).rig.brake == from_one.rig.brake);
  const Perturbation scaled = draw(Variation::parse("wheels=0.1,measured"), 3, 5);
  CHECK_THAT(perturbed(one, scaled).rig.wheels.J1_kg_m2, WithinRel(scaled.J1 * from_one.rig.wheels.J1_kg_m2, 1e-15));
}

TEST_CASE("a perturbation changes the parameter that it names") {
  const plant_sim::PlantOptions nominal;
  Perturbation p;
  p.J2 = 1.1;
  p.brake_gain = 0.9;
  p.c31 = 1.05;
  p.B = 0.95;
  p.theta = 1.08;
  const plant_sim::PlantOptions plant = perturbed(nominal, p);
  CHECK_THAT(plant.rig.wheels.J2_kg_m2, WithinRel(1.1 * nominal.rig.wheels.J2_kg_m2, 1e-14));
  CHECK(plant.rig.wheels.J1_kg_m2 == nominal.rig.wheels.J1_kg_m2);
  CHECK_THAT(plant.rig.brake.b1_Nm, WithinRel(0.9 * nominal.rig.brake.b1_Nm, 1e-14));
  CHECK_THAT(plant.rig.brake.b2_Nm, WithinRel(0.9 * nominal.rig.brake.b2_Nm, 1e-14));
  CHECK_THAT(plant.rig.brake.c31_per_s, WithinRel(1.05 * nominal.rig.brake.c31_per_s, 1e-14));
  CHECK_THAT(plant.rig.tyre.B, WithinRel(0.95 * nominal.rig.tyre.B, 1e-14));
  CHECK_THAT(plant.rig.tyre.theta_N, WithinRel(1.08 * nominal.rig.tyre.theta_N, 1e-14));
}

TEST_CASE("with the maker's curve and lever theta scales the friction and B the slip axis") {
  plant_sim::PlantOptions nominal;
  nominal.tyre = "inteco-mu";
  nominal.load = "lever";
  Perturbation p;
  p.theta = 0.9;
  p.B = 1.1;
  const plant_sim::PlantOptions plant = perturbed(nominal, p);
  const auto mu = [](const plant_sim::IntecoMuParameters& m, double s) {
    return m.w4 * std::pow(s, m.p) / (m.a + std::pow(s, m.p));
  };
  for (const double slip : {0.01, 0.05, 0.3}) {
    CHECK_THAT(mu(plant.inteco_mu, slip), WithinRel(0.9 * mu(nominal.inteco_mu, 1.1 * slip), 1e-12));
  }
  CHECK(plant.rig.tyre.theta_N == nominal.rig.tyre.theta_N);
}

TEST_CASE("every plant of the widest variation is valid") {
  const Variation widest = Variation::parse("parameters=0.5,theta=0.5,radii=0.5,phase");
  for (std::uint64_t k = 0; k < 300; ++k) {
    const plant_sim::PlantOptions plant = perturbed({}, draw(widest, 1, k));
    REQUIRE_NOTHROW(plant_sim::check(plant));
    CHECK(plant.rig.tyre.C <= 2.0);
  }
}
