// The speed observer around standstill: stops, flicker of a count, slow turning, reversal.
#include <algorithm>
#include <cmath>

#include "catch.hpp"
#include "control/tracking_observer.hpp"
#include "control/wheel_encoder.hpp"

using namespace abs_hil;
using bench::encoder_reading;
using Catch::Matchers::WithinAbs;

namespace {

const control::ObserverOptions options{};
const double rates_Hz[] = {100.0, 1000.0, 10000.0};

}  // namespace

TEST_CASE("A wheel that stops is at exactly 0 after the standstill time, and starts again at once") {
  for (const double rate_Hz : rates_Hz) {
    CAPTURE(rate_Hz);
    const double dt = 1.0 / rate_Hz;
    // 100 rad/s, locked by 1000 rad/s^2 within 0.1 s, at rest until 0.4 s, then off with 50 rad/s^2.
    const auto angle = [](double t) {
      const double braked = std::min(t, 0.1), off = std::max(t - 0.4, 0.0);
      return 100.0 * braked - 500.0 * braked * braked + 25.0 * off * off;
    };
    control::TrackingObserver observer{options, 4096};
    observer.reset(0, 100.0);
    for (int n = 1; n * dt < 0.6; ++n) {
      const double t = n * dt;
      observer.update(encoder_reading(angle(t), 4096), dt);
      CAPTURE(t);
      // After a lock the filter must not swing far through zero: less than one count passes.
      if (t > 0.11 && t < 0.4) CHECK(observer.omega_rad_s() > -0.9);
      if (t > 0.125 && t < 0.4) CHECK(std::abs(observer.omega_rad_s()) < 0.3);
      if (t > 0.1 + options.standstill_time_s + 0.012 && t < 0.4) {
        CHECK(observer.omega_rad_s() == 0.0);
        CHECK(observer.alpha_rad_s2() == 0.0);
        CHECK(observer.stands_still());
      }
      if (t > 0.43) CHECK_FALSE(observer.stands_still());
      if (t > 0.5) CHECK_THAT(observer.omega_rad_s(), WithinAbs(50.0 * (t - 0.4), 0.4));
    }
  }
}

TEST_CASE("A single flicker of the count at rest is small and soon over") {
  for (const double rate_Hz : rates_Hz) {
    CAPTURE(rate_Hz);
    const double dt = 1.0 / rate_Hz;
    control::TrackingObserver observer{options, 4096};
    observer.reset(10, 0.0);
    double worst = 0.0;
    for (int n = 1; n * dt < 0.4; ++n) {
      const double t = n * dt;
      const bool flicker = n == static_cast<int>(0.2 * rate_Hz);
      observer.update(flicker ? 11 : 10, dt);
      worst = std::max(worst, std::abs(observer.omega_rad_s()));
      if (t > 0.2 + options.standstill_time_s + 2.0 * dt) CHECK(observer.omega_rad_s() == 0.0);
    }
    CHECK(worst < 0.2);  // a count in one period would be 1.5 rad/s at 1 kHz
  }
}

TEST_CASE("Slow rotation with rare counts is tracked on average and keeps its sign") {
  for (const double omega : {0.1, -0.1, 0.5, 2.0}) {
    CAPTURE(omega);
    control::TrackingObserver observer{options, 4096};
    observer.reset(0, 0.0);
    double sum = 0.0, worst = 0.0;
    int count = 0;
    for (int n = 1; n <= 5000; ++n) {
      observer.update(encoder_reading(omega * n * 1e-3 + 1e-5, 4096), 1e-3);
      if (n < 1000) continue;
      sum += observer.omega_rad_s();
      worst = std::max(worst, std::abs(observer.omega_rad_s() - omega));
      ++count;
    }
    CHECK_THAT(sum / count, WithinAbs(omega, 0.12 * std::abs(omega)));
    CHECK(worst < 0.12);
  }
}

TEST_CASE("A wheel that reverses is followed through zero") {
  for (const double rate_Hz : rates_Hz) {
    CAPTURE(rate_Hz);
    const double dt = 1.0 / rate_Hz;
    control::TrackingObserver observer{options, 4096};
    observer.reset(0, 20.0);
    for (int n = 1; n * dt < 0.8; ++n) {
      const double t = n * dt;
      observer.update(encoder_reading(20.0 * t - 25.0 * t * t, 4096), dt);
      CAPTURE(t);
      if (t > 0.2) CHECK_THAT(observer.omega_rad_s(), WithinAbs(20.0 - 50.0 * t, 0.3));
    }
  }
}

TEST_CASE("The standstill time is the one asked for") {
  control::TrackingObserver observer{{.standstill_time_s = 0.2}, 4096};
  observer.reset(0, 0.0);
  for (int n = 1; n < 200; ++n) {
    observer.update(0, 1e-3);
    CHECK_FALSE(observer.stands_still());
  }
  observer.update(0, 1e-3);
  observer.update(0, 1e-3);
  CHECK(observer.stands_still());
  observer.update(1, 1e-3);
  CHECK_FALSE(observer.stands_still());
  CHECK(observer.omega_rad_s() > 0.0);
}
