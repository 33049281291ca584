// What the torques on their way lead to, against a fine integration of (1), (2), (6) and closed forms.
#include "control/state_predictor.hpp"

#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "catch.hpp"
#include "control/brake_actuator.hpp"
#include "control/braking_bench.hpp"

using namespace abs_hil;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

using State = control::ActingState<double>;

double slip_of(const rig::WheelParameters& w, const State& x) {
  return 1.0 - w.r1_m * x.speeds.omega1_rad_s / (w.r2_m * x.speeds.omega2_rad_s);
}

State predicted(const rig::RigParameters& rig, const std::vector<double>& torques_Nm, double part_s, const State& now) {
  const rig::TyreParameters& t = rig.tyre;
  return control::BasicStatePredictor<double>(rig, 0.3)({torques_Nm, part_s}, now, 0.0, [&](double slip) {
    const double angle = t.C * std::atan(t.B * slip);
    return control::CurvePoint<double>{t.theta_N * std::sin(angle),
                                       t.theta_N * std::cos(angle) * t.C * t.B / (1.0 + t.B * slip * t.B * slip)};
  });
}

}  // namespace

TEST_CASE("The predicted slip is that of a fine integration, and its error falls with the length of the parts") {
  std::mt19937_64 random{7};
  const auto draw = [&](double least, double most) {
    return least + (most - least) * static_cast<double>(random() >> 11U) * 0x1p-53;
  };
  double worst = 0.0, sum = 0.0, sum_of_half = 0.0;
  for (int i = 0; i < 200; ++i) {
    bench::Setup s{.ideal_actuator = false, .plant_step_s = 1e-5};
    s.rig.tyre = {draw(15.0, 50.0), draw(10.0, 30.0), draw(1.2, 1.8)};
    s.rig.brake.c31_per_s = draw(15.0, 300.0);
    const auto& w = s.rig.wheels;
    const double omega2 = draw(60.0, 170.0), slip = draw(0.0, 0.1);
    const State now{{(1.0 - slip) * w.r2_m * omega2 / w.r1_m, omega2}, draw(0.0, 6.0)};
    bench::PlantState x{.omega1 = now.speeds.omega1_rad_s, .omega2 = omega2, .torque = now.brake_torque_Nm};
    std::vector<double> parts, halves;
    for (int part = 0; part < 4; ++part) {
      const double torque_Nm = draw(0.0, 6.0);
      parts.push_back(torque_Nm);
      halves.insert(halves.end(), 2, torque_Nm);
      bench::integrate(x, s, s.rig.tyre.theta_N, torque_Nm, 0.006);
    }
    const double truth = slip_of(w, {{x.omega1, x.omega2}, x.torque});
    if (!(truth < 0.5)) continue;
    const State end = predicted(s.rig, parts, 0.006, now);
    CHECK_THAT(end.brake_torque_Nm, WithinAbs(x.torque, 1e-9));
    const double error = std::abs(slip_of(w, end) - truth);
    worst = std::max(worst, error);
    sum += error;
    sum_of_half += std::abs(slip_of(w, predicted(s.rig, halves, 0.003, now)) - truth);
  }
  CHECK(worst < 0.02);
  CHECK(sum / sum_of_half > 1.5);
}

TEST_CASE("Without force and friction both wheels turn on as a constant torque lets them, exactly") {
  rig::RigParameters rig;
  rig.wheels.d1_Nms_rad = rig.wheels.d2_Nms_rad = rig.wheels.M10_Nm = rig.wheels.M20_Nm = 0.0;
  rig.tyre.theta_N = 0.0;
  const State now{{150.0, 160.0}, 3.0};
  const State end = predicted(rig, {3.0, 3.0, 3.0}, 0.008, now);
  CHECK_THAT(end.speeds.omega2_rad_s, WithinRel(160.0, 1e-14));
  CHECK_THAT(end.speeds.omega1_rad_s, WithinRel(150.0 - 3.0 / rig.wheels.J1_kg_m2 * 0.024, 1e-12));
  CHECK(end.brake_torque_Nm == 3.0);
  const State same = predicted(rig, {}, 0.0, now);
  CHECK(same.speeds.omega1_rad_s == now.speeds.omega1_rad_s);
}

TEST_CASE("The torques on their way are the means of those sent a dead time ago, for any dead time") {
  for (const double dead_s : {0.0007, 0.003, 0.0132, 0.024, 0.2}) {
    rig::BrakeParameters brake;
    brake.brake_dead_time_s = dead_s;
    control::BrakeActuator actuator{brake, false, 1.0};
    std::mt19937_64 random{11};
    std::vector<std::pair<double, double>> sent{{-1.0, 0.0}};  // time and static torque
    double now_s = 0.0;
    for (int n = 0; n < 300; ++n) {
      const double duty = static_cast<double>(random() >> 11U) * 0x1p-53;
      actuator.command(duty, 0.0);
      sent.emplace_back(now_s, duty >= brake.u0 ? brake.b1_Nm * duty + brake.b2_Nm : 0.0);
      now_s += 0.001;
      actuator.advance(0.001);
    }
    const auto ahead = actuator.ahead();
    REQUIRE_THAT(ahead.part_s * static_cast<double>(ahead.torques_Nm.size()), WithinRel(dead_s, 1e-12));
    for (std::size_t part = 0; part < ahead.torques_Nm.size(); ++part) {
      const double begin_s = now_s - dead_s + static_cast<double>(part) * ahead.part_s;
      double mean_Nm = 0.0;
      for (std::size_t i = 0; i < sent.size(); ++i) {
        const double until_s = i + 1 < sent.size() ? sent[i + 1].first : now_s;
        const double lasts_s = std::min(until_s, begin_s + ahead.part_s) - std::max(sent[i].first, begin_s);
        mean_Nm += sent[i].second * std::max(0.0, lasts_s) / ahead.part_s;
      }
      CAPTURE(dead_s, part);
      CHECK_THAT(ahead.torques_Nm[part], WithinAbs(mean_Nm, 1e-6));
    }
  }
}

TEST_CASE("No torque is on its way without a dead time, with an ideal actuator and at the start") {
  rig::BrakeParameters brake;
  CHECK(control::BrakeActuator(brake, false, 1.0).ahead().torques_Nm.empty());
  brake.brake_dead_time_s = 0.01;
  CHECK(control::BrakeActuator(brake, true, 1.0).ahead().torques_Nm.empty());
  control::BrakeActuator actuator{brake, false, 1.0};
  for (const double torque_Nm : actuator.ahead().torques_Nm) CHECK(torque_Nm == 0.0);
}
