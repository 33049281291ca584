// The brake's map and lag, and their inverse, in closed form.
#include "control/brake_actuator.hpp"

#include <cmath>
#include <limits>
#include <random>

#include "catch.hpp"

using namespace abs_hil;
using Catch::Matchers::WithinAbs;

namespace {

const rig::BrakeParameters brake{};

double map_Nm(double duty) { return duty >= brake.u0 ? brake.b1_Nm * duty + brake.b2_Nm : 0.0; }

}  // namespace

TEST_CASE("The inverse of the brake map gives back every torque that the map can give") {
  const control::BrakeActuator actuator{brake, false, 1.0};
  const double least = map_Nm(brake.u0), most = map_Nm(1.0);
  CHECK_THAT(actuator.max_torque_Nm(), WithinAbs(most, 1e-12));
  for (double torque = least; torque <= most; torque += 0.01) {
    const double duty = actuator.duty_for(torque);
    CHECK((duty >= brake.u0 && duty <= 1.0));
    CHECK_THAT(map_Nm(duty), WithinAbs(torque, 1e-12));
    CHECK_THAT(actuator.limited(torque), WithinAbs(torque, 1e-12));
  }
}

TEST_CASE("Torques beyond the map are limited, those in the dead zone go to the nearer end of it") {
  const control::BrakeActuator actuator{brake, false, 1.0};
  const double least = map_Nm(brake.u0);
  CHECK(actuator.limited(-3.0) == 0.0);
  CHECK(actuator.duty_for(-3.0) == 0.0);
  CHECK(actuator.limited(0.49 * least) == 0.0);
  CHECK(actuator.duty_for(0.49 * least) == 0.0);
  CHECK_THAT(actuator.limited(0.51 * least), WithinAbs(least, 1e-12));
  CHECK_THAT(actuator.limited(1000.0), WithinAbs(map_Nm(1.0), 1e-12));
  CHECK(actuator.duty_for(1000.0) == 1.0);

  const control::BrakeActuator weaker{brake, false, 0.8};
  CHECK_THAT(weaker.max_torque_Nm(), WithinAbs(map_Nm(0.8), 1e-12));
  CHECK_THAT(weaker.limited(1000.0), WithinAbs(map_Nm(0.8), 1e-12));
  CHECK(weaker.duty_for(1000.0) == 0.8);
}

TEST_CASE("The lag's torque and its mean are exact for any step, also a jittering one") {
  control::BrakeActuator actuator{brake, false, 1.0};
  std::mt19937 random{3};
  std::uniform_real_distribution<double> step_s{1e-5, 0.05}, duty{0.0, 1.0};
  double torque = 0.0;
  for (int i = 0; i < 300; ++i) {
    const double u = duty(random), dt = step_s(random);
    actuator.command(u, std::numeric_limits<double>::quiet_NaN());  // on the rig only the duty acts
    actuator.advance(dt);
    // Independent: Tb' = c31 (b(u) - Tb) by fine RK4, its mean by Simpson's rule over the same steps.
    const double target = map_Nm(u);
    const int n = 400;
    const double h = dt / n;
    double integral = 0.0;
    for (int j = 0; j < n; ++j) {
      const auto rate = [&](double y) { return brake.c31_per_s * (target - y); };
      const double k1 = rate(torque), k2 = rate(torque + h / 2 * k1), k3 = rate(torque + h / 2 * k2),
                   k4 = rate(torque + h * k3);
      const double next = torque + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
      const double middle = (torque + next) / 2 + h / 8 * (rate(torque) - rate(next));
      integral += h / 6 * (torque + 4 * middle + next);
      torque = next;
    }
    CHECK_THAT(actuator.torque_Nm(), WithinAbs(torque, 1e-9));
    CHECK_THAT(actuator.mean_torque_Nm(), WithinAbs(integral / dt, 1e-9));
  }
}

TEST_CASE("With dead times the estimate is that of the duties that act by now, at any step") {
  rig::BrakeParameters late = brake;
  late.brake_dead_time_s = 0.0129;
  late.brake_release_lead_s = 0.0037;
  control::BrakeActuator actuator{late, false, 1.0};
  control::BrakeActuator prompt{brake, false, 1.0};
  const double dt = GENERATE(1e-3, 0.37e-3, 8e-3);
  // A pulse of 30 ms: it acts from 12.9 to 39.2 ms.
  const double begins_s = 0.0129, ends_s = 0.03 + 0.0092;
  double time_s = 0.0;
  for (int cycle = 0; time_s < 0.1; ++cycle) {
    const double from_s = time_s;
    actuator.command(from_s < 0.03 - 1e-9 ? 0.8 : 0.0, 0.0);
    // The first cycle from 30 ms on releases it.
    const double released_s = dt * std::ceil(0.03 / dt - 1e-9);
    actuator.advance(dt);
    time_s = dt * (cycle + 1);
    double impulse_Nms = 0.0;
    for (double at_s = from_s; at_s < time_s - 1e-12;) {
      const double off_s = released_s + ends_s - 0.03;
      const bool on = at_s > begins_s - 1e-12 && at_s < off_s - 1e-12;
      const double next_s = at_s < begins_s - 1e-12 ? begins_s : on ? off_s : 1.0;
      const double part_s = std::min(next_s, time_s) - at_s;
      prompt.command(on ? 0.8 : 0.0, 0.0);
      prompt.advance(part_s);
      impulse_Nms += part_s * prompt.mean_torque_Nm();
      at_s += part_s;
    }
    REQUIRE_THAT(actuator.torque_Nm(), WithinAbs(prompt.torque_Nm(), 1e-9));
    REQUIRE_THAT(actuator.mean_torque_Nm(), WithinAbs(impulse_Nms / dt, 1e-9));
  }
  CHECK(actuator.torque_Nm() > 0.1);
  // Its state goes on elsewhere with the duties that are under way.
  actuator.command(1.0, 0.0);
  rig::StateBytes kept;
  actuator.exchange_state(kept);
  const std::string bytes = kept.written();
  control::BrakeActuator other{late, false, 1.0};
  rig::StateBytes again(bytes);
  other.exchange_state(again);
  actuator.advance(0.02);
  other.advance(0.02);
  CHECK(other.torque_Nm() == actuator.torque_Nm());
  CHECK(other.torque_Nm() > 0.5);
  actuator.reset();
  actuator.advance(0.1);
  CHECK(actuator.torque_Nm() == 0.0);
}

TEST_CASE("Full brake reaches 63.2 % of its torque after one time constant") {
  control::BrakeActuator actuator{brake, false, 1.0};
  actuator.command(1.0, 0.0);
  for (int i = 0; i < 7; ++i) actuator.advance(1.0 / brake.c31_per_s / 7.0);
  CHECK_THAT(actuator.torque_Nm() / actuator.max_torque_Nm(), WithinAbs(1.0 - std::exp(-1.0), 1e-12));
  actuator.reset();
  CHECK(actuator.torque_Nm() == 0.0);
  actuator.advance(0.01);
  CHECK(actuator.torque_Nm() == 0.0);
}

TEST_CASE("With an ideal actuator the torque asked for acts at once, without limits") {
  control::BrakeActuator actuator{brake, true, 1.0};
  CHECK(std::isinf(actuator.max_torque_Nm()));
  CHECK(actuator.limited(50.0) == 50.0);
  CHECK(actuator.limited(0.01) == 0.01);
  CHECK(actuator.limited(-1.0) == 0.0);
  CHECK(actuator.duty_for(50.0) == 1.0);
  actuator.command(0.0, 12.5);
  CHECK(actuator.torque_Nm() == 12.5);
  actuator.advance(0.003);
  CHECK(actuator.mean_torque_Nm() == 12.5);
  actuator.command(0.0, 4.0);
  CHECK(actuator.torque_Nm() == 4.0);
  CHECK(actuator.mean_torque_Nm() == 12.5);  // still that of the past interval
}

TEST_CASE("Only what limits and refusals held back counts as unsent, not the PWM's steps and the dead zone") {
  for (const std::uint32_t steps : {0U, 255U, 4095U}) {
    const control::BrakeActuator actuator{brake, false, 0.7, steps};
    CAPTURE(steps);
    const double most = actuator.max_torque_Nm();
    const auto unsent = [&](double torque, double sent) {
      return actuator.unsent_Nm(torque, actuator.limited(torque), sent);
    };
    for (double torque = 0.0; torque <= most; torque += 0.003) {
      REQUIRE(actuator.unsent_Nm(torque, actuator.limited(torque), actuator.limited(torque)) == 0.0);
    }
    CHECK_THAT(unsent(most + 0.5, most), WithinAbs(0.5, 1e-12));
    CHECK_THAT(unsent(-0.5, 0.0), WithinAbs(-0.5, 1e-12));
    CHECK_THAT(unsent(3.0, 1.0), WithinAbs(2.0, 1e-12));   // rate-limited
    CHECK_THAT(unsent(3.0, 0.0), WithinAbs(3.0, 1e-12));   // refused
    CHECK_THAT(unsent(1.0, 3.0), WithinAbs(-2.0, 1e-12));  // an older command still acts
  }
}

TEST_CASE("A torque that is not finite has no duty and no static torque") {
  for (const bool ideal : {false, true}) {
    const control::BrakeActuator actuator{brake, ideal, 1.0, 4095};
    for (const double torque : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
      CHECK(std::isnan(actuator.limited(torque)));
      CHECK(std::isnan(actuator.duty_for(torque)));
    }
  }
}

TEST_CASE("A lag too long to move within a step leaves the torque where it is") {
  control::BrakeActuator actuator{{.c31_per_s = 5e-324}, false, 1.0};
  actuator.command(1.0, 0.0);
  actuator.advance(1e-3);
  CHECK(actuator.torque_Nm() == 0.0);
  CHECK(actuator.mean_torque_Nm() == 0.0);
}

TEST_CASE("In the gap that the dead zone leaves, the torque is right in the mean and switches no faster than the PWM") {
  const rig::BrakeParameters wide{.u0 = 0.6};
  for (const double dt_s : {1e-4, 1e-3, 5e-3, 1e-2}) {
    for (const double torque : {0.1, 0.7, 1.4, 2.0, 2.8}) {
      CAPTURE(dt_s, torque);
      control::BrakeActuator actuator{wide, false, 1.0, 4095};
      const double least = wide.b1_Nm * 2457.0 / 4095.0 + wide.b2_Nm;  // 2457/4095 = 0.6
      double sum = 0.0, before = -1.0, since_s = 1.0;
      const int cycles = static_cast<int>(4.0 / dt_s);
      for (int n = 0; n < cycles; ++n) {
        const double sent = actuator.next(torque, dt_s).torque_Nm;
        REQUIRE((sent == 0.0 || std::abs(sent - least) < 1e-12));
        CHECK(actuator.unsent_Nm(torque, sent, sent) == 0.0);
        if (n > 0 && sent != before) {
          CHECK(since_s >= std::max(dt_s, 1.0 / 160.0) - 1e-9);
          since_s = 0.0;
        }
        since_s += dt_s;
        before = sent;
        sum += sent;
      }
      CHECK_THAT(sum / cycles, WithinAbs(torque, 0.02));
    }
  }
}

TEST_CASE("Outside the gap nothing is carried from cycle to cycle") {
  control::BrakeActuator actuator{brake, false, 0.7, 255};
  for (double torque = -1.0; torque < 6.0; torque += 0.01) {
    const double least = map_Nm(106.0 / 255.0);
    if (torque > 0.0 && torque < least) continue;
    CHECK(actuator.next(torque, 1e-3).torque_Nm == actuator.limited(torque));
    CHECK(actuator.next(torque, 1e-3).duty == actuator.duty_for(torque));
  }
}
