#pragma once

#include <array>
#include <cstddef>

#include "abs_hil/control/options.hpp"
#include "abs_hil/rig/parameters.hpp"
#include "control/speed_tracker.hpp"
#include "rig/pack.hpp"

namespace abs_hil::control {

/// Delays a signal as LowerWheelForce delays the force: `q` = `covered()`.
template <class S>
struct ForceDelay {
  std::array<S, 3> lag{S(0.0), S(0.0), S(0.0)};
  S last{0.0}, before{0.0};

  S operator()(double q, const S& now) noexcept {
    // A force sampled now and in the two cycles before: the mean acceleration of the two intervals that the filter's
    // newest second difference spans.
    S x = 0.25 * (now + 2.0 * last + before);
    before = last;
    last = now;
    for (S& y : lag) x = y = y + q * (x - y);
    return x;
  }
  void shift(const S& by) noexcept {
    for (S& y : lag) y = y + by;
    last = last + by;
    before = before + by;
  }
};

/// Tyre force from the lower wheel alone, J2 omega2' = -r2 F - d2 omega2 - M20: neither the brake nor its model enters.
/// A fading-memory filter with a triple pole follows the angle by which the force alone turns the wheel back. Its
/// response to F is known exactly. To compare F with a curve, pass the curve through the same delay (`ForceDelay`).
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
  /// Expected -phi'' at the peak.
  [[nodiscard]] double curvature() const noexcept { return curvature_; }
  [[nodiscard]] double peak_force_N() const noexcept { return peak_force_N_; }
  /// Force of the curve at the readings of late, as late as the quick force.
  [[nodiscard]] double late_force_N() const noexcept { return late_force_N_; }
  [[nodiscard]] bool jumping() const noexcept { return hold_s_ > 0.0; }
  [[nodiscard]] int jumps() const noexcept { return jumps_; }

 private:
  /// Members of one shape side by side, as the vectors of any machine compute them.
  using Row = rig::Pack<rig::Portable, 4>;
  static constexpr std::size_t rows = members / Row::lanes;
  static constexpr std::size_t rows_a_shape = peaks / Row::lanes;
  static constexpr std::size_t terms = 10;

  /// A shape phi of (4) over u = s/(1 + s), s = |slip| over its knee: phi = u P(u), and the slope of phi over u.
  struct Shape {
    std::array<double, terms> value{};
    std::array<double, terms> slope{};
  };
  struct Members {
    Row knee;  ///< slips 1/B
    Row peak;  ///< slips
    Row bent;  ///< -phi'' at the peak
    Row prior;
    Row theta_N, zero;
    Row theta_variance, covariance, zero_variance;
    Row weight;
    ForceDelay<Row> phi;
    Row now;  ///< the curve at the last reading
  };
  /// What all members compare their curves with in a cycle.
  struct Look {
    double slip, late_slip, covered;
    double force_N;
    double noise_N2;      ///< variance of the force
    double slip_error2;   ///< variance of the slip
    double theta_growth;  ///< of the variance of ln theta
    double zero_growth;   ///< of the variance of the zero
    double back;          ///< share of the weights that returns to the prior
    bool learns, compares;
  };

  [[nodiscard]] static Row value(const Shape& shape, const Row& knee, const Row& slip) noexcept;
  [[nodiscard]] static Row slope(const Shape& shape, const Row& knee, const Row& slip) noexcept;
  static void learn(const Shape& shape, const Look& look, Members& m) noexcept;
  void watch_for_jumps(const Data& data) noexcept;
  void summarise() noexcept;

  FrictionBankOptions options_;
  double rate_Hz_;
  double quick_delay_s_;
  std::array<Shape, shapes> shapes_{};
  std::array<Members, rows> bank_{};
  ForceDelay<double> late_slip_;
  double time_s_{0.0};
  double hold_s_{0.0};
  double unexplained_s_{0.0};
  double force_N_{0.0};
  double late_force_N_{0.0};
  double curvature_{0.0};
  double peak_slip_{0.0}, slip_zero_{0.0}, peak_force_N_{0.0};
  int jumps_{0};
};

}  // namespace abs_hil::control
