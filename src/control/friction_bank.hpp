#pragma once

#include <array>
#include <cstddef>

#include "abs_hil/control/options.hpp"
#include "abs_hil/rig/parameters.hpp"
#include "control/speed_tracker.hpp"

namespace abs_hil::control {

/// Tyre force from the lower wheel alone, J2 omega2' = -r2 F - d2 omega2 - M20: neither the brake nor its model enters.
/// A fading-memory filter with a triple pole follows the angle by which the force alone turns the wheel back. Its
/// response to F is known exactly. To compare F with a curve, pass the curve through the same delay (`Delay`).
/// Real-time safe.
class LowerWheelForce {
 public:
  /// @param bandwidth_rad_s  of the triple pole, > 0
  LowerWheelForce(const rig::WheelParameters& wheels, double bandwidth_rad_s) noexcept;

  void reset(double omega2_rad_s) noexcept;
  /// @param travel_rad  that the lower wheel turned in `dt_s` > 0
  /// @param omega2_rad_s  for the viscous friction only
  void update(double dt_s, double travel_rad, double omega2_rad_s) noexcept;
  [[nodiscard]] double force_N() const noexcept { return force_N_; }
  /// What a filter of one pole covers of its distance in the last interval.
  [[nodiscard]] double covered() const noexcept { return covered_; }

  /// Delays a signal as the filter delays the force: `q` = `covered()`.
  struct Delay {
    std::array<double, 3> lag{};
    double last{0.0}, before{0.0};
    double operator()(double q, double now) noexcept {
      // A force sampled now and in the two cycles before: the mean acceleration of the two intervals that the filter's
      // newest second difference spans.
      double x = 0.25 * (now + 2.0 * last + before);
      before = last;
      last = now;
      for (double& y : lag) x = y += q * (x - y);
      return x;
    }
    void shift(double by) noexcept {
      for (double& y : lag) y += by;
      last += by;
      before += by;
    }
    [[nodiscard]] double value() const noexcept { return lag[2]; }
  };

 private:
  rig::WheelParameters wheels_;
  double bandwidth_rad_s_;
  SpeedTracker<double> tracker_;
  double free_rad_s_{0.0};  ///< speed without tyre force
  double covered_{0.0};
  double force_N_{0.0};
};

/// Learns the tyre's curve F(slip) from slip and force. A bank of shapes of (4), with different peak slips and shape
/// factors, explains the data side by side. Each member is a Kalman filter of two unknowns, its height theta and the
/// slip reading at no force (the radii are known to 1 % only). The likelihood of the data weighs the members; a small
/// share returns to the prior, so that no member dies (fixed share). Peak and force are means over the bank. Friction
/// that jumps scales all members alike: a quick estimate of the force tells it. Real-time safe except for the
/// constructor.
class FrictionBank {
 public:
  static constexpr std::size_t peaks = 8;   ///< different slips of the peak
  static constexpr std::size_t shapes = 3;  ///< different shape factors C
  static constexpr std::size_t members = peaks * shapes;

  /// @param quick_delay_s  by which `Data::quick_force_N` follows the force, > 0
  /// Throws std::invalid_argument for options out of range.
  FrictionBank(const FrictionBankOptions& options, double rate_Hz, double quick_delay_s);

  struct Data {
    double dt_s{0.0};  ///< > 0
    double slip{0.0};
    double car_speed_m_s{0.0};
    double force_N{0.0};        ///< of LowerWheelForce
    double covered{0.0};        ///< of LowerWheelForce
    double quick_force_N{0.0};  ///< less exact and less delayed
  };
  void reset() noexcept;
  void learn(const Data& data) noexcept;

  struct Force {
    double N{0.0};
    double spread_N{0.0};  ///< standard deviation
  };
  /// Expected force at a reading of the slip.
  [[nodiscard]] Force at(double slip) const noexcept;
  /// Expected force at the last reading.
  [[nodiscard]] double force_N() const noexcept { return force_N_; }
  /// Reading of the slip at which the expected loss of force is least (the members taken as parabolas at their peaks),
  /// without the reading at no force.
  [[nodiscard]] double peak_slip() const noexcept { return peak_slip_; }
  /// Reading of the slip at no force is minus this.
  [[nodiscard]] double slip_zero() const noexcept { return slip_zero_; }
  [[nodiscard]] double peak_force_N() const noexcept { return peak_force_N_; }
  /// Force of the curve at the readings of late, as late as the quick force.
  [[nodiscard]] double late_force_N() const noexcept { return late_force_N_; }
  [[nodiscard]] bool jumping() const noexcept { return hold_s_ > 0.0; }
  [[nodiscard]] int jumps() const noexcept { return jumps_; }

 private:
  static constexpr std::size_t table_steps = 128;
  struct Member {
    double theta_N, zero;
    double theta_variance, covariance, zero_variance;
    double weight;
    LowerWheelForce::Delay phi;
  };
  struct Point {
    double value, slope;
  };

  [[nodiscard]] Point curve(std::size_t index, double slip) const noexcept;
  void watch_for_jumps(const Data& data) noexcept;
  /// Takes the means, with each member's `now` as its curve at the last reading.
  void summarise(const std::array<double, members>& now) noexcept;

  FrictionBankOptions options_;
  double rate_Hz_;
  double quick_delay_s_;
  std::array<double, peaks> peak_slips_{};
  std::array<double, members> bent_{};  ///< -phi'' at the peak
  /// phi over u = x/(1 + x), x = slip over the peak's slip.
  std::array<std::array<double, table_steps + 2>, shapes> table_{};
  std::array<double, members> prior_{};
  std::array<Member, members> bank_{};
  LowerWheelForce::Delay late_slip_;
  double time_s_{0.0};
  double hold_s_{0.0};
  double unexplained_s_{0.0};
  double force_N_{0.0};
  double late_force_N_{0.0};
  double peak_slip_{0.0}, slip_zero_{0.0}, peak_force_N_{0.0};
  int jumps_{0};
};

}  // namespace abs_hil::control
