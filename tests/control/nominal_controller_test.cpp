// The law for a known tyre: e_v decays as the sum of two exponentials.
#include <cmath>

#include "catch.hpp"
#include "control/braking_bench.hpp"
#include "control/classic_controllers.hpp"

using namespace abs_hil;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

/// Largest distance of e_v from the two exponentials, while braking.
double worst_deviation_m_s(const bench::Setup& s, const bench::Result& run) {
  const auto& gains = s.options.adaptive;
  const double error0 = run.ticks.front().output.slip_velocity_error_m_s;
  double worst = 0.0;
  for (const auto& tick : run.ticks) {
    const double wanted = bench::closed_form(0.0, error0, gains.ks0, gains.ks1, tick.t)[1];
    worst = std::max(worst, std::abs(bench::e_v(s.rig.wheels, tick.omega1, tick.omega2, s.options.slip_ref) - wanted));
  }
  return worst;
}

/// (16) computed at the tick and held, without the sampled-data form.
class PrintedLaw final : public control::SlipController {
 public:
  explicit PrintedLaw(const bench::Setup& s) : setup_{s} {}
  void reset(const control::SlipInput& in) noexcept override {
    integral_ = 0.0;
    error_ = bench::e_v(setup_.rig.wheels, in.speeds.omega1_rad_s, in.speeds.omega2_rad_s, in.slip_ref);
  }
  control::SlipOutput step(const control::SlipInput& in) noexcept override {
    const auto& w = setup_.rig.wheels;
    const double error = bench::e_v(w, in.speeds.omega1_rad_s, in.speeds.omega2_rad_s, in.slip_ref);
    integral_ += in.dt_s * (error_ + error) / 2;
    error_ = error;
    const double k = w.r1_m * w.r1_m / w.J1_kg_m2 + (1 - in.slip_ref) * w.r2_m * w.r2_m / w.J2_kg_m2;
    const double phi = std::sin(setup_.rig.tyre.C * std::atan(setup_.rig.tyre.B * in.slip));
    const double drift = -w.r1_m / w.J1_kg_m2 * (w.d1_Nms_rad * in.speeds.omega1_rad_s + w.M10_Nm) +
                         (1 - in.slip_ref) * w.r2_m / w.J2_kg_m2 * (w.d2_Nms_rad * in.speeds.omega2_rad_s + w.M20_Nm);
    return {w.J1_kg_m2 / w.r1_m * (-19 * integral_ - 32 * error + k * setup_.rig.tyre.theta_N * phi + drift), error,
            setup_.rig.tyre.theta_N};
  }

 private:
  const bench::Setup& setup_;
  double integral_{0.0}, error_{0.0};
};

}  // namespace

TEST_CASE("With the right theta and an ideal actuator e_v is the sum of two exponentials, at any rate") {
  struct Case {
    double rate_Hz, limit_m_s;
  };
  for (const auto& c :
       {Case{100, 0.04}, Case{200, 6e-3}, Case{500, 1e-3}, Case{1000, 3e-4}, Case{2000, 1e-4}, Case{10000, 1e-5}}) {
    CAPTURE(c.rate_Hz);
    bench::Setup s;
    s.options.rate_Hz = c.rate_Hz;
    const auto run = bench::brake(s, "nominal");
    CHECK(worst_deviation_m_s(s, run) < c.limit_m_s);
    CHECK_THAT(run.stop_time_s, WithinRel(2.277, 0.005));
    CHECK_THAT(run.stop_distance_m, WithinRel(19.36, 0.005));
  }
}

TEST_CASE("The sampled-data form beats the printed law held over the period") {
  for (const double rate_Hz : {100.0, 1000.0, 10000.0}) {
    CAPTURE(rate_Hz);
    bench::Setup s;
    s.options.rate_Hz = rate_Hz;
    PrintedLaw printed{s};
    CHECK(worst_deviation_m_s(s, bench::brake(s, "nominal")) < 0.3 * worst_deviation_m_s(s, bench::brake(s, printed)));
  }
}

TEST_CASE("Predicting half a period ahead does not amplify the noise of the encoders") {
  const auto total_variation_Nm = [](const bench::Result& run) {
    double sum = 0.0;
    for (std::size_t n = 1; n < run.ticks.size() && run.ticks[n].omega2 * 0.0990 > 3.0; ++n) {
      sum += std::abs(run.ticks[n].output.brake_torque_Nm - run.ticks[n - 1].output.brake_torque_Nm);
    }
    return sum;
  };
  for (const double rate_Hz : {200.0, 1000.0, 5000.0}) {
    CAPTURE(rate_Hz);
    bench::Setup s;
    s.options.rate_Hz = rate_Hz;
    s.ideal_actuator = false;
    s.encoders = true;
    PrintedLaw printed{s};
    const double sampled_Nm = total_variation_Nm(bench::brake(s, "nominal"));
    CHECK(sampled_Nm < 1.05 * total_variation_Nm(bench::brake(s, printed)));
  }
}

TEST_CASE("The exponentials hold for other plants, speeds and references") {
  for (const double theta : {10.0, 30.0, 45.0, 60.0}) {
    for (const double slip_ref : {0.05, 0.15, 0.3}) {
      for (const double start : {60.0, 120.0, 180.0}) {
        CAPTURE(theta, slip_ref, start);
        bench::Setup s;
        s.rig.tyre.theta_N = theta;
        s.options.slip_ref = slip_ref;
        s.omega1_start = s.omega2_start = start;
        const auto run = bench::brake(s, "nominal");
        CHECK(worst_deviation_m_s(s, run) < 0.01);
        CHECK(run.stop_time_s < 8.0);
      }
    }
  }
}

TEST_CASE("After a step of the slip reference e_v follows the exponentials") {
  class Stepping final : public control::SlipController {
   public:
    explicit Stepping(const bench::Setup& s) : inner_{{s.options, s.rig}} {}
    void reset(const control::SlipInput& in) noexcept override { inner_.reset(in); }
    control::SlipOutput step(const control::SlipInput& in) noexcept override {
      control::SlipInput changed = in;
      if (n_++ >= 500) changed.slip_ref = 0.10;
      return inner_.step(changed);
    }

   private:
    control::LawController<control::NominalLaw> inner_;
    int n_{0};
  };
  bench::Setup s;
  Stepping stepping{s};
  const auto run = bench::brake(s, stepping);
  const auto first = bench::closed_form(0.0, run.ticks[0].output.slip_velocity_error_m_s, 19, 32, 0.5);
  const double jump = 0.05 * s.rig.wheels.r2_m * run.ticks[500].omega2;
  CHECK_THAT(run.ticks[500].output.slip_velocity_error_m_s, WithinAbs(first[1] + jump, 1e-3));
  for (std::size_t n = 500; n < 1500; ++n) {
    const double wanted =
        bench::closed_form(first[0], first[1] + jump, 19, 32, (static_cast<double>(n) - 500) * 1e-3)[1];
    CHECK_THAT(run.ticks[n].output.slip_velocity_error_m_s, WithinAbs(wanted, 2e-3));
  }
}

TEST_CASE("theta0 is the plant's own unless another is asked for") {
  rig::RigParameters rig;
  rig.tyre.theta_N = 31.0;
  control::ControlOptions options;
  const control::SlipInput in{.speeds = {140.0, 170.0}, .slip = 0.17, .slip_ref = 0.15, .max_brake_torque_Nm = 9.0};
  const auto theta_of = [&] {
    control::LawController<control::NominalLaw> controller{{options, rig}};
    controller.reset(in);
    return controller.step(in).theta_est_N;
  };
  CHECK(theta_of() == 31.0);
  options.nominal.theta0_N = 12.0;
  CHECK(theta_of() == 12.0);
}

TEST_CASE("While the torque is limited the integral does not wind up") {
  // A brake of 1 N m cannot bring the slip up: e_v stays far below 0 for a second.
  const rig::RigParameters rig;
  const control::ControlOptions options;
  control::LawController<control::NominalLaw> controller{{options, rig}};
  control::SlipInput stuck{
      .dt_s = 1e-3, .speeds = {160.0, 162.0}, .slip = 0.005, .slip_ref = 0.15, .max_brake_torque_Nm = 1.0};
  controller.reset(stuck);
  control::SlipInput first = stuck;
  first.dt_s = 0.0;
  const double at_start = controller.step(first).brake_torque_Nm;
  REQUIRE(at_start > 1.0);
  double last = 0.0;
  for (int n = 0; n < 1000; ++n) {
    bench::note_sent(stuck, at_start);
    last = controller.step(stuck).brake_torque_Nm;
  }
  CHECK(last == at_start);

  control::SlipInput unlimited = stuck;
  unlimited.max_brake_torque_Nm = 100.0;
  bench::note_sent(
      unlimited,
      controller.step(unlimited).brake_torque_Nm);  // from here on the request is within range, and e_v counts
  CHECK(controller.step(unlimited).brake_torque_Nm > at_start);
}
