// The speed observer against the continuous one with its triple pole.
#include "control/tracking_observer.hpp"

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "catch.hpp"
#include "control/wheel_encoder.hpp"

using namespace abs_hil;
using bench::encoder_reading;
using bench::fine_counts_per_rev;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

const control::ObserverOptions options{.bandwidth_rad_s = 100.0};  // the noise bounds below are for this one

}  // namespace

TEST_CASE("A constant acceleration is followed without steady error at any rate") {
  const double alpha = -70.0, omega0 = 170.0;
  for (const double rate_Hz : {100.0, 500.0, 1000.0, 2000.0, 5000.0, 10000.0}) {
    CAPTURE(rate_Hz);
    control::TrackingObserver observer{options, fine_counts_per_rev};
    observer.reset(0, 0.0);  // the speed is unknown
    const double dt = 1.0 / rate_Hz;
    for (double t = dt; t < 1.0; t += dt) {
      observer.update(encoder_reading(omega0 * t + alpha * t * t / 2, fine_counts_per_rev), dt);
      if (t < 0.4) continue;
      CHECK_THAT(observer.omega_rad_s(), WithinAbs(omega0 + alpha * t, 1e-3));
      CHECK_THAT(observer.alpha_rad_s2(), WithinAbs(alpha, 0.1));
    }
  }
}

TEST_CASE("A jittering period leaves no error under constant acceleration") {
  std::mt19937 random{5};
  std::uniform_real_distribution<double> period_s{0.2e-3, 3e-3};
  const double alpha = -70.0, omega0 = 170.0;
  control::TrackingObserver observer{options, fine_counts_per_rev};
  observer.reset(0, 150.0);
  for (double t = 0.0; t < 2.0;) {
    const double dt = period_s(random);
    t += dt;
    observer.update(encoder_reading(omega0 * t + alpha * t * t / 2, fine_counts_per_rev), dt);
    if (t > 0.4) CHECK_THAT(observer.omega_rad_s(), WithinAbs(omega0 + alpha * t, 2e-3));
  }
}

TEST_CASE("A step of the speed is answered like the continuous observer with its triple pole at -bandwidth") {
  // Residual r = s^3/(s + w)^3 angle; with angle = step/s^2 the speed estimate is
  // step (1 - exp(-w t)(1 + w t - (w t)^2)).
  const double step = 20.0;
  for (const double w : {50.0, 100.0, 200.0}) {
    control::ObserverOptions tuned{.bandwidth_rad_s = w};
    for (const double rate_Hz : {2000.0, 5000.0, 10000.0}) {
      CAPTURE(w, rate_Hz);
      control::TrackingObserver observer{tuned, fine_counts_per_rev};
      observer.reset(0, 0.0);
      const double dt = 1.0 / rate_Hz;
      double worst = 0.0;
      for (int n = 1; n * dt < 12.0 / w; ++n) {
        const double t = n * dt;
        observer.update(encoder_reading(step * t, fine_counts_per_rev), dt);
        // Every reading is used at once, so the discrete answer runs ahead of the continuous one by half a period.
        const double x = w * (t + dt / 2);
        const double continuous = step * (1.0 - std::exp(-x) * (1.0 + x - x * x));
        worst = std::max(worst, std::abs(observer.omega_rad_s() - continuous) / step);
      }
      CHECK(worst < 0.25 * w * dt);
      CHECK(worst < 0.02 + 0.1 * w * dt);
    }
  }
}

TEST_CASE("The estimate hardly depends on the rate") {
  // Speed that a braked wheel might have: falling, with a wobble of 3 Hz.
  const auto omega = [](double t) { return 170.0 - 60.0 * t + 5.0 * std::sin(20.0 * t); };
  const auto angle = [](double t) { return 170.0 * t - 30.0 * t * t + 0.25 * (1.0 - std::cos(20.0 * t)); };
  std::vector<double> lags;
  for (const double rate_Hz : {500.0, 1000.0, 2000.0, 5000.0, 10000.0}) {
    CAPTURE(rate_Hz);
    control::TrackingObserver observer{options, 4096};
    observer.reset(0, 170.0);
    const double dt = 1.0 / rate_Hz;
    for (int n = 1; n * dt < 1.5; ++n) {
      observer.update(encoder_reading(angle(n * dt), 4096), dt);
      if (n * dt > 0.3) CHECK_THAT(observer.omega_rad_s(), WithinAbs(omega(n * dt), 0.6));
    }
  }
}

TEST_CASE("Quantisation noise stays far below that of the difference of counts") {
  for (const double rate_Hz : {500.0, 1000.0, 5000.0, 10000.0}) {
    CAPTURE(rate_Hz);
    // A falling speed sweeps through all beats between counts and cycles.
    const auto omega = [](double t) { return 150.0 - 60.0 * t; };
    const double dt = 1.0 / rate_Hz;
    control::TrackingObserver observer{options, 4096};
    observer.reset(0, omega(0.0));
    double square = 0.0, raw_square = 0.0, worst = 0.0;
    std::int32_t before = 0;
    int count = 0;
    for (int n = 1; n * dt < 2.0; ++n) {
      const double t = n * dt;
      const std::int32_t reading = encoder_reading(150.0 * t - 30.0 * t * t, 4096);
      observer.update(reading, dt);
      const double raw = (reading - before) * 2 * std::numbers::pi / 4096 / dt;
      before = reading;
      if (t < 0.2) continue;
      square += std::pow(observer.omega_rad_s() - omega(t), 2);
      raw_square += std::pow(raw - omega(t), 2);
      worst = std::max(worst, std::abs(observer.omega_rad_s() - omega(t)));
      ++count;
    }
    CHECK(std::sqrt(square / count) < 0.03);
    CHECK(worst < 0.15);
    CHECK(std::sqrt(raw_square / count) > 10.0 * std::sqrt(square / count));
  }
}

TEST_CASE("The counter's wrap-around has no effect") {
  const auto run = [](std::int64_t offset, double direction) {
    control::TrackingObserver observer{options, 4096};
    observer.reset(encoder_reading(0.0, 4096, offset), direction * 100.0);
    std::vector<double> omegas;
    for (int n = 1; n <= 500; ++n) {
      const double t = n * 1e-3;
      observer.update(encoder_reading(direction * (100.0 * t - 20.0 * t * t), 4096, offset), 1e-3);
      omegas.push_back(observer.omega_rad_s());
    }
    return omegas;
  };
  const auto near_end = std::int64_t{std::numeric_limits<std::int32_t>::max()} - 5000;
  CHECK(run(0, 1.0) == run(near_end, 1.0));
  CHECK(run(0, -1.0) == run(-near_end, -1.0));
}

TEST_CASE("Precision does not decay with the way that the wheel has turned") {
  // Ten hours at 180 rad/s and 100 Hz: 4.2e9 counts, several wraps.
  control::TrackingObserver observer{options, 4096};
  const double counts_per_step = 180.0 * 0.01 * 4096 / (2 * std::numbers::pi);
  observer.reset(0, 180.0);
  double worst_first = 0.0, worst_last = 0.0;
  const int steps = 3'600'000;
  for (int n = 1; n <= steps; ++n) {
    const auto reading = static_cast<std::int64_t>(std::floor(counts_per_step * n));
    observer.update(static_cast<std::int32_t>(static_cast<std::uint32_t>(reading)), 0.01);
    const double error = std::abs(observer.omega_rad_s() - 180.0);
    if (n <= 10'000) worst_first = std::max(worst_first, error);
    if (n > steps - 10'000) worst_last = std::max(worst_last, error);
  }
  CHECK(worst_last < 0.15);
  CHECK(worst_last < 1.2 * worst_first);
}

TEST_CASE("A reading without time passing is left for the next one") {
  control::TrackingObserver observer{options, 4096}, plain{options, 4096};
  observer.reset(0, 50.0);
  plain.reset(0, 50.0);
  observer.update(7, 0.0);
  CHECK(observer.omega_rad_s() == 50.0);
  observer.update(33, 1e-3);
  plain.update(33, 1e-3);
  CHECK(observer.omega_rad_s() == plain.omega_rad_s());
}

TEST_CASE("After a gap far above 1/bandwidth the observer restarts from the mean speed over the gap") {
  control::TrackingObserver observer{options, fine_counts_per_rev};
  const double alpha = -70.0;
  const auto angle = [&](double t) { return 170.0 * t + alpha * t * t / 2; };
  observer.reset(0, 170.0);
  for (int n = 1; n <= 500; ++n) observer.update(encoder_reading(angle(n * 1e-3), fine_counts_per_rev), 1e-3);
  REQUIRE_THAT(observer.omega_rad_s(), WithinAbs(135.0, 1e-2));
  // 0.6 s later the wheel has stopped decelerating at once: it turned at 90 rad/s all the time.
  observer.update(encoder_reading(angle(0.5) + 54.0, fine_counts_per_rev), 0.6);
  CHECK_THAT(observer.omega_rad_s(), WithinAbs(90.0, 1e-2));
  CHECK(observer.alpha_rad_s2() == 0.0);
  observer.update(encoder_reading(angle(0.5) + 54.09, fine_counts_per_rev), 1e-3);
  CHECK_THAT(observer.omega_rad_s(), WithinAbs(90.0, 1e-1));
}

TEST_CASE("A late reading with an uncertain stamp does not throw the estimate") {
  // The reading that began at 0.501 s took 9 ms, its stamp says the middle, but its counts are those of the end.
  for (const double alpha_max : {343.0, 3011.0}) {
    control::TrackingObserver observer{options, 4096, alpha_max};
    observer.reset(0, 164.0);
    const auto reading = [](double t) { return encoder_reading(164.0 * t, 4096); };
    for (int n = 1; n <= 500; ++n) observer.update(reading(n * 1e-3), 1e-3);
    observer.update(reading(0.510), 5.5e-3, 4.5e-3);
    CHECK_THAT(observer.omega_rad_s(), WithinAbs(164.0, 0.2));
    observer.update(reading(0.511), 5.5e-3, 5e-6);
    CHECK_THAT(observer.omega_rad_s(), WithinAbs(164.0, 0.2));
    for (int n = 512; n <= 560; ++n) {
      observer.update(reading(n * 1e-3), 1e-3, 5e-6);
      CHECK_THAT(observer.omega_rad_s(), WithinAbs(164.0, 0.2));
    }
  }
}

TEST_CASE("The same late reading is believed if its stamp is certain, or if it is the third in a row") {
  const auto estimate = [](double stamp_error_s, int readings) {
    control::TrackingObserver observer{options, 4096, 343.0};
    observer.reset(0, 164.0);
    std::int32_t counts = 0;
    for (int n = 1; n <= 500; ++n) observer.update(counts = encoder_reading(0.164 * n, 4096), 1e-3);
    for (int n = 0; n < readings; ++n) observer.update(counts += 400, 1e-3, stamp_error_s);
    return observer.omega_rad_s();
  };
  CHECK(estimate(5e-6, 1) > 170.0);
  CHECK_THAT(estimate(1e-3, 1), WithinAbs(164.0, 0.2));
  CHECK_THAT(estimate(1e-3, 2), WithinAbs(164.0, 0.2));
  CHECK(estimate(1e-3, 3) > 170.0);
}
