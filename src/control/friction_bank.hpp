// The tyre's curve F(slip) from readings of slip and force: a bank of Kalman filters. docs/theory-beyond.md derives it
// ("adaptive-optimal"). Multiple-model estimation (Magill 1965) with fixed share (Herbster and Warmuth 1998).
//
// Member i is a curve of (4) with its own shape factor C and slip L of its peak, and two unknowns: its height theta, N,
// and the zero z of the slip reading (which is -z where no force acts). l is the slip as read, H the delay of
// LowerWheelForce, h the time since the last reading, s, f the control rate, Hz.
//
//   curve        phi(s) = sin(C atan(B s)),  B = tan(pi / (2 C)) / L,  F(l) = theta phi(l + z)
//   prediction   Ptt += q theta^2,  Pzz += qz                                 variances of theta, N^2, and of z
//   gradient     g = (H phi - phi' (H l - l'), theta phi'(l' + z))            l': the reading that is as late as F
//   noise        R = f (N + T (eF F)^2 + T A^2 / 2) + (theta phi')^2 f T ((et l.)^2 + (sv^2 + va^2) / v^2),  T = 5 ms,
//                v: car speed, A, va: swing of force and speed that discs cause; 10^6 f (N + ...) in the first
//                `start_s`
//   update       S = g P g' + R,  K = P g' / S,  r = F - theta g_1,  (theta, z) += K r,  P -= K (P g')'
//   weight       w <- (w + a h w0) exp(-r^2 / (2 S)) / sqrt(S),  then all weights are divided by their sum
//   force        F(l) = sum w theta phi(l + z),  peak force = sum w theta,  zero = sum w z
//   peak         sum w c L / sum w c,  c = -phi''(L) (1 + past_peak_cost Ri [L < the last peak])
//   runaway      Ri = runaway_per_N theta (-phi''(L)) L / 10                  of the slip, a tenth past the peak
//
// N, eF, et, sv and a are the options force_noise_N2_s, force_error, timing_error_s, slip_noise_m_s and share_per_s.
// q = h (level_drift_per_s + level_drift_unexplained_per_s (unexplained force / peak force)^2).
// qz = h zero_drift_per_s. l. is the rate of the slip, 1/s. The radii are known to 1 % only, hence the zero. The share
// a of the prior w0 keeps every member alive.
//
// Friction has jumped when the quick force differs from the curve's for `jump_confirm_s`. For `jump_hold_s` then
// nothing is learnt but one factor of all heights: theta <- theta (1 + (1 - exp(-h / jump_time_constant_s)) r / F).
#pragma once

#include <array>
#include <cstddef>

#include "abs_hil/control/options.hpp"
#include "control/lower_wheel_force.hpp"
#include "rig/pack.hpp"

namespace abs_hil::control {

/// Learns the tyre's curve by the equations above. Real-time safe except for the constructor.
class FrictionBank {
 public:
  static constexpr std::size_t peaks = 8;   ///< different slips of the peak
  static constexpr std::size_t shapes = 3;  ///< different shape factors C
  static constexpr std::size_t members = peaks * shapes;

  /// @param quick_delay_s  by which `Data::quick_force_N` follows the force, > 0
  /// Throws std::invalid_argument for options out of range.
  FrictionBank(const FrictionBankOptions& options, double rate_Hz, double quick_delay_s);

  /// Amplitudes of the once-a-turn errors that encoder discs off their centres may cause; 0: the discs are known.
  struct Swing {
    double force_N{0.0};
    double quick_force_N{0.0};
    double speed_m_s{0.0};
  };
  struct Data {
    double dt_s{0.0};  ///< > 0
    double slip{0.0};
    double late_slip{0.0};  ///< as late as `force_N`
    double car_speed_m_s{0.0};
    double force_N{0.0};        ///< of LowerWheelForce
    double covered{0.0};        ///< of LowerWheelForce
    double quick_force_N{0.0};  ///< less exact and less delayed
    Swing swing{};
    /// The rate at which the slip grows for each newton that the force falls per unit of slip, r1^2 / (J1 v), over the
    /// brake's rate c31; 1/N.
    double runaway_per_N{0.0};
  };
  /// Readings as braking begins: without force, they are the slip at no force.
  struct Start {
    double slip{0.0};
    double car_speed_m_s{0.0};  ///< > 0
    double force_N{0.0};        ///< of the tyre
    double swing_m_s{0.0};      ///< of the difference of both speeds, by their discs
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
  /// The slip at which the expected loss of force is least. It counts from no force: the reading there is this less
  /// `slip_zero`.
  [[nodiscard]] double peak_slip() const noexcept { return peak_slip_; }
  /// z: the slip reads -z where no force acts.
  [[nodiscard]] double slip_zero() const noexcept { return slip_zero_; }
  /// Rate at which the slip grows a tenth past the peak, over the brake's rate c31. From 1 on the brake is too slow to
  /// catch it.
  [[nodiscard]] double runaway() const noexcept { return runaway_; }
  [[nodiscard]] double peak_force_N() const noexcept { return peak_force_N_; }
  /// Somewhat less than the geometric mean of the members' peaks: what the next braking on the same tyre may begin
  /// with. Not for the cycle.
  [[nodiscard]] double learnt_peak_slip() const noexcept;
  /// Force of the curve at the readings, delayed as the quick force is.
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
