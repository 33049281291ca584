// Cost of integrating the plant, compared with a plain RK4 loop and Boost.odeint on the same equations: one braking
// from 170 rad/s under a constant duty, 2 s in ticks of 1 ms. `error_rad_s` is the largest difference of the upper
// wheel's speed, at any tick, from RK4 at 1 us; compare costs only at similar errors.

#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <boost/numeric/odeint/integrate/integrate_adaptive.hpp>
#include <boost/numeric/odeint/stepper/generation.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta4.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_dopri5.hpp>
#include <cmath>
#include <vector>

#include "abs_hil/plant_sim/plant.hpp"

namespace {

namespace odeint = boost::numeric::odeint;

constexpr double duty = 0.55;
constexpr double tick_s = 1e-3;
constexpr int ticks = 2000;
constexpr double start_rad_s = 170.0;

using State = std::array<double, 3>;  ///< omega1, omega2 in rad/s, brake torque in N m

/// (1)-(7) with both wheels turning forwards, written without code of abs_hil.
struct Equations {
  void operator()(const State& x, State& dx, double /*t*/) const {
    constexpr double r1 = 0.0995, r2 = 0.0990, J1 = 7.54e-3, J2 = 25.60e-3, d1 = 118.74e-6, d2 = 214.68e-6;
    constexpr double M10 = 0.0032, M20 = 0.0925, theta = 23.0, B = 28.0, C = 1.68, b1 = 15.24, b2 = -6.21, c31 = 20.37;
    const double slip = (r2 * x[1] - r1 * x[0]) / (r2 * x[1]);
    const double force = theta * std::sin(C * std::atan(B * slip));
    dx[0] = (r1 * force - d1 * x[0] - M10 - x[2]) / J1;
    dx[1] = (-r2 * force - d2 * x[1] - M20) / J2;
    dx[2] = c31 * (b1 * duty + b2 - x[2]);
  }
};

void rk4_step(State& x, double h) {
  const Equations f;
  State k1, k2, k3, k4, y;
  f(x, k1, 0.0);
  for (std::size_t i = 0; i < 3; ++i) y[i] = x[i] + 0.5 * h * k1[i];
  f(y, k2, 0.0);
  for (std::size_t i = 0; i < 3; ++i) y[i] = x[i] + 0.5 * h * k2[i];
  f(y, k3, 0.0);
  for (std::size_t i = 0; i < 3; ++i) y[i] = x[i] + h * k3[i];
  f(y, k4, 0.0);
  for (std::size_t i = 0; i < 3; ++i) x[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
}

/// omega1 at every tick of a braking; `advance(state)` integrates one tick.
template <class Advance>
std::vector<double> brake(const Advance& advance) {
  State x{start_rad_s, start_rad_s, 0.0};
  std::vector<double> omega1(ticks);
  for (double& omega : omega1) {
    advance(x);
    omega = x[0];
  }
  return omega1;
}

auto rk4(int steps) {
  return [steps](State& x) {
    for (int i = 0; i < steps; ++i) rk4_step(x, tick_s / steps);
  };
}

auto odeint_rk4(int steps) {
  return [steps](State& x) {
    odeint::runge_kutta4<State> stepper;
    for (int i = 0; i < steps; ++i) stepper.do_step(Equations{}, x, 0.0, tick_s / steps);
  };
}

void odeint_dopri5(State& x) {
  const auto stepper = odeint::make_controlled(1e-8, 1e-6, odeint::runge_kutta_dopri5<State>());
  odeint::integrate_adaptive(stepper, Equations{}, x, 0.0, tick_s, tick_s);
}

std::vector<double> brake_plant() {
  abs_hil::plant_sim::Plant plant{{}};
  plant.reset({.omega1_rad_s = start_rad_s, .omega2_rad_s = start_rad_s});
  std::vector<double> omega1(ticks);
  for (double& omega : omega1) {
    plant.advance(tick_s, {.brake_duty = duty});
    omega = plant.state().omega1_rad_s;
  }
  return omega1;
}

double error_of(const std::vector<double>& omega1) {
  static const std::vector<double> exact = brake(rk4(1000));
  double largest = 0.0;
  for (std::size_t i = 0; i < omega1.size(); ++i) largest = std::max(largest, std::abs(omega1[i] - exact[i]));
  return largest;
}

template <class Run>
void measure(benchmark::State& state, const Run& run) {
  std::vector<double> omega1;
  for (auto _ : state) benchmark::DoNotOptimize(omega1 = run());
  state.counters["error_rad_s"] = error_of(omega1);
}

void plant(benchmark::State& state) { measure(state, brake_plant); }
void hand_written_rk4(benchmark::State& state) {
  measure(state, [&] { return brake(rk4(static_cast<int>(state.range(0)))); });
}
void boost_rk4(benchmark::State& state) {
  measure(state, [&] { return brake(odeint_rk4(static_cast<int>(state.range(0)))); });
}
void boost_dopri5(benchmark::State& state) {
  measure(state, [] { return brake(odeint_dopri5); });
}

BENCHMARK(plant)->Unit(benchmark::kMillisecond);
BENCHMARK(hand_written_rk4)->Arg(10)->Arg(2)->Arg(1)->Unit(benchmark::kMillisecond);
BENCHMARK(boost_rk4)->Arg(10)->Arg(2)->Arg(1)->Unit(benchmark::kMillisecond);
BENCHMARK(boost_dopri5)->Unit(benchmark::kMillisecond);

}  // namespace
