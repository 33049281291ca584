#pragma once

#include <array>
#include <cstddef>

#include "abs_hil/control/options.hpp"
#include "control/lower_wheel_force.hpp"
#include "rig/pack.hpp"

namespace abs_hil::control {

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
    double late_slip{0.0};  ///< as late as `force_N`
    double car_speed_m_s{0.0};
    double force_N{0.0};        ///< of LowerWheelForce
    double covered{0.0};        ///< of LowerWheelForce
    double quick_force_N{0.0};  ///< less exact and less delayed
    /// By how fast the slip runs away where the force falls by a newton, over the rate at which the brake acts.
    double runaway_per_N{0.0};
  };
  /// Readings as braking begins: without force, they are the slip at no force.
  struct Start {
    double slip{0.0};
    double car_speed_m_s{0.0};  ///< > 0
    double force_N{0.0};        ///< of the tyre
  };
  void reset(const Start& start) noexcept;
  void learn(const Data& data) noexcept;

  struct Force {
    double N{0.0};
    double spread_N{0.0};  ///< standard deviation
  };
  /// Expected force at a reading of the slip.
  [[nodiscard]] Force at(double slip) const noexcept;
  /// Expected force at the last reading.
  [[nodiscard]] double force_N() const noexcept { return force_N_; }
  /// Reading of the slip at which the expected loss is least, without the reading at no force. The members are taken as
  /// parabolas at their peaks, and a peak that is passed costs more by `past_peak_cost` times its runaway.
  [[nodiscard]] double peak_slip() const noexcept { return peak_slip_; }
  /// Reading of the slip at no force is minus this.
  [[nodiscard]] double slip_zero() const noexcept { return slip_zero_; }
  /// Expected runaway of the slip a tenth past the peak, over the rate at which the brake acts: from 1 on, the brake is
  /// too slow to catch it.
  [[nodiscard]] double runaway() const noexcept { return runaway_; }
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
    double slip_offset;  ///< of the delayed readings from `late_slip`
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
  void summarise(double runaway_per_N) noexcept;

  FrictionBankOptions options_;
  double rate_Hz_;
  double quick_delay_s_;
  std::array<Shape, shapes> shapes_{};
  std::array<Members, rows> bank_{};
  ForceDelay<double> late_slip_;
  double time_s_{0.0};
  double hold_s_{0.0};
  double unexplained_s_{0.0};
  double unexplained_N_{0.0};  ///< of the force of late
  double force_N_{0.0};
  double late_force_N_{0.0};
  double runaway_{0.0};
  double peak_slip_{0.0}, slip_zero_{0.0}, peak_force_N_{0.0};
  int jumps_{0};
};

}  // namespace abs_hil::control
