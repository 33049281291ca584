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
// z stays within 0.01, and its first standard deviation, of what the slip read as braking began.
// q = h (level_drift_per_s + level_drift_unexplained_per_s (unexplained force / peak force)^2).
// qz = h zero_drift_per_s. l. is the rate of the slip, 1/s. The radii are known to 1 % only, hence the zero. The share
// a of the prior w0 keeps every member alive.
//
// Friction has jumped when the quick force differs from the curve's, F, for `jump_confirm_s` by more than
//   max(jump_least_N, jump_share peak force) + jump_slip_m_s F / (v peak slip) + the swing of the quick force,
// where the second term is what an error of the slip does on the rising curve. Then, for `jump_hold_s`, only one factor
// of all heights is learnt: theta <- theta (1 + (1 - exp(-h / jump_time_constant_s)) r / F).
#pragma once

#include <array>
#include <cstddef>
#include <cstring>
#include <type_traits>

#include "abs_hil/control/options.hpp"
#include "abs_hil/rig/scalar.hpp"
#include "control/lower_wheel_force.hpp"
#include "control/state_predictor.hpp"
#include "rig/pack.hpp"

// The curves of FrictionBank, phi(s) = sin(C atan(s / knee)) of (4) over the slip s: numbers, value and slope. Numbers
// that a solver or the C library gave stand here as such: their rounding depends on the platform, and every platform
// computes the same bits.
namespace abs_hil::control::friction_curves {

inline constexpr std::size_t peaks = 8;   ///< different slips of the peak
inline constexpr std::size_t shapes = 3;  ///< different shape factors C
inline constexpr std::size_t terms = 10;

template <class S>
[[nodiscard, gnu::always_inline]] constexpr S square(const S& x) noexcept {
  return x * x;
}

/// A number for each peak, in whole vectors of any machine.
struct alignas(64) OfPeaks : std::array<double, peaks> {};

/// Slips of the peak in a geometric row, 0.02 12.5^(j / 7). The plants have 0.03 to 0.25.
inline constexpr OfPeaks peak{{0x1.47ae147ae147bp-6, 0x1.d60ed332dc69bp-6, 0x1.512653e35d90ep-5, 0x1.e3a46a533e111p-5,
                               0x1.5ae4a268047ap-4, 0x1.f19e816b430a5p-4, 0x1.64eb0658ab2dfp-3, 0.25}};
/// C in an even row. The plants have 1.27 to 1.9.
inline constexpr std::array<double, shapes> shape{1.15, 1.525, 1.9};
/// tan(pi / (2 C)): the slip of the peak over the knee.
inline constexpr std::array<double, shapes> peak_over_knee{0x1.33fc22fa97c4ep+2, 0x1.aa54f13d10739p+0,
                                                           0x1.161712d7187f5p+0};

/// For each C the coefficients of the polynomial in u = B s / (1 + B s) that meets sin(C atan(B s)) / u at the
/// Chebyshev nodes of (0, 1).
inline constexpr std::array<std::array<double, terms>, shapes> curves{
    {{0x1.266ccf142c2cbp+0, 0x1.216f5725c5018p+0, 0x1.204329cf3fc6dp+0, -0x1.fdee1083627cp+2, 0x1.3477b71ff3cd3p+5,
      -0x1.f1c11634415f9p+6, 0x1.7fb3a7b1bc924p+7, -0x1.23170ca85a028p+7, 0x1.980a58609c7dcp+5, -0x1.796fac91ff7fbp+2},
     {0x1.867653c51eb33p+0, 0x1.7a0a1d8dc779ep+0, 0x1.f714160d4583dp+0, -0x1.4349359013b5p+4, 0x1.9cb2f0fdf044p+6,
      -0x1.54d4d85d30d4cp+8, 0x1.205d725e2fd6bp+9, -0x1.fe061f658e3efp+8, 0x1.c6451b596b1cdp+7, -0x1.42235fd0c3f34p+5},
     {0x1.e687537b974ecp+0, 0x1.ccd046493bb27p+0, 0x1.aa8ba6554ba69p+1, -0x1.52d38b75ba953p+5, 0x1.c07c56891cc48p+7,
      -0x1.79462da21ea11p+9, 0x1.50532cbdd5c16p+10, -0x1.3fbac82564e1bp+10, 0x1.36d1ca7a234ddp+9,
      -0x1.e8f3987e65308p+6}}};

/// What follows for each curve: its knee 1/B, -phi'' at its peak, and the coefficients of the slope over u.
struct Derived {
  std::array<OfPeaks, shapes> knee{};
  std::array<OfPeaks, shapes> bent{};
  std::array<std::array<double, terms>, shapes> slope{};
};
inline constexpr Derived derived = [] {
  Derived d;
  for (std::size_t k = 0; k < shapes; ++k) {
    const double at_peak = peak_over_knee[k];
    const double curvature = square(shape[k] * at_peak / (1.0 + square(at_peak)));  // slip in units of the peak's
    for (std::size_t j = 0; j < peaks; ++j) {
      d.knee[k][j] = peak[j] / at_peak;
      d.bent[k][j] = curvature / square(peak[j]);
    }
    for (std::size_t i = 0; i < terms; ++i) d.slope[k][i] = static_cast<double>(i + 1) * curves[k][i];
  }
  return d;
}();

template <class Row>
[[nodiscard, gnu::always_inline]] inline Row horner(const std::array<double, terms>& c, const Row& x) noexcept {
  Row sum = c.back();
  for (std::size_t i = c.size() - 1; i-- > 0;) sum = sum * x + c[i];
  return sum;
}

/// phi at the slip, of curves of the k-th shape with these knees.
template <class Row>
[[nodiscard, gnu::always_inline]] inline Row value(std::size_t k, const Row& knee, const Row& slip) noexcept {
  const Row size = rig::magnitude(slip);
  const Row u = size / (knee + size);
  return rig::with_sign(u * horner(curves[k], u), slip);
}

/// Its slope over the slip.
template <class Row>
[[nodiscard, gnu::always_inline]] inline Row slope(std::size_t k, const Row& knee, const Row& slip) noexcept {
  const Row size = rig::magnitude(slip);
  const Row share = 1.0 / (knee + size);
  return horner(derived.slope[k], size * share) * knee * share * share;
}

}  // namespace abs_hil::control::friction_curves

namespace abs_hil::control {

/// Learns the tyre's curve by the equations above. Real-time safe except for the constructor. In lanes each member is a
/// pack, and sums run in the same order.
template <class S>
class BasicFrictionBank {
 public:
  static constexpr std::size_t peaks = friction_curves::peaks;
  static constexpr std::size_t shapes = friction_curves::shapes;

  BasicFrictionBank() = default;
  /// @param quick_delay_s  by which `Data::quick_force_N` follows the force, > 0
  /// Throws std::invalid_argument for options out of range.
  /// @param force_scale  of the rig (RigScale), > 0, which all forces of the options are multiplied with
  BasicFrictionBank(const FrictionBankOptions<>& options, double rate_Hz, double quick_delay_s,
                    double force_scale = 1.0);

  /// Amplitudes of the once-a-turn errors that encoder discs off their centres may cause; 0: the discs are known.
  struct Swing {
    S force_N{0.0};
    S quick_force_N{0.0};
    S speed_m_s{0.0};
  };
  struct Data {
    S dt_s{0.0};  ///< > 0
    S slip{0.0};
    S late_slip{0.0};  ///< as late as `force_N`
    S car_speed_m_s{0.0};
    S force_N{0.0};        ///< of LowerWheelForce
    S covered{0.0};        ///< of LowerWheelForce
    S quick_force_N{0.0};  ///< less exact and less delayed
    Swing swing{};
    /// The rate at which the slip grows for each newton that the force falls per unit of slip, r1^2 / (J1 v), over the
    /// brake's rate c31; 1/N.
    S runaway_per_N{0.0};
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
    S N{0.0};
    S spread_N{0.0};  ///< standard deviation
  };
  /// Expected force at a reading of the slip.
  [[nodiscard]] Force at(const S& slip) const noexcept;
  /// The same without its spread, and its slope over the slip.
  [[nodiscard]] CurvePoint<S> point(const S& slip) const noexcept;
  /// Expected force at the last reading.
  [[nodiscard]] const S& force_N() const noexcept { return force_N_; }
  /// The slip at which the expected loss of force is least. It counts from no force: the reading there is this less
  /// `slip_zero`.
  [[nodiscard]] const S& peak_slip() const noexcept { return peak_slip_; }
  /// z: the slip reads -z where no force acts.
  [[nodiscard]] const S& slip_zero() const noexcept { return slip_zero_; }
  /// Rate at which the slip grows a tenth past the peak, over the brake's rate c31. From 1 on the brake is too slow to
  /// catch it.
  [[nodiscard]] const S& runaway() const noexcept { return runaway_; }
  [[nodiscard]] const S& peak_force_N() const noexcept { return peak_force_N_; }
  /// Somewhat less than the geometric mean of the members' peaks: what the next braking on the same tyre may begin
  /// with. Not for the cycle.
  [[nodiscard]] double learnt_peak_slip() const noexcept;
  /// Force of the curve at the readings, delayed as the quick force is.
  [[nodiscard]] const S& late_force_N() const noexcept { return late_force_N_; }
  [[nodiscard]] auto jumping() const noexcept { return hold_s_ > 0.0; }
  [[nodiscard]] const S& jumps() const noexcept { return jumps_; }

 private:
  /// Members of one shape that are computed at once: of a run alone as many as the vectors of any machine hold, in
  /// lanes one.
  static constexpr bool alone = std::is_same_v<S, double>;
  using Row = std::conditional_t<alone, rig::Pack<rig::Portable, 4>, S>;
  static constexpr std::size_t rows_a_shape = alone ? 1 : peaks;
  /// A word of each member of a shape. Lanes have the same words as a run alone, so the same alignment in words.
  struct alignas(2 * sizeof(S)) LaneWords : std::array<S, peaks> {};
  using Words = std::conditional_t<alone, Row, LaneWords>;

  struct LaneDelay {
    std::array<Words, 3> lags{};
    Words last{}, before{};
  };
  /// Those of one shape.
  struct Members {
    Words theta_N{}, zero{};
    Words theta_variance{}, covariance{}, zero_variance{};
    Words weight{};
    std::conditional_t<alone, ForceDelay<Row>, LaneDelay> phi{};  ///< `last`: at the last reading
  };
  /// What all members compare their curves with in a cycle.
  struct Look {
    S slip, late_slip, covered;
    S slip_offset;  ///< of the delayed readings from `late_slip`
    S force_N;
    S noise_N2;      ///< variance of the force
    S slip_error2;   ///< variance of the slip
    S theta_growth;  ///< of the variance of ln theta
    S zero_growth;   ///< of the variance of the zero
    S back;          ///< share of the weights that returns to the prior
  };
  /// A sum over all members. Those of a run alone have the order of its vectors: even and odd peaks apart.
  class Sum {
   public:
    void add(std::size_t row, const Row& of_all_shapes) noexcept {
      if constexpr (alone) {
        auto sum = of_all_shapes.v[0];
        for (std::size_t i = 1; i < std::size(of_all_shapes.v); ++i) sum += of_all_shapes.v[i];
        even_ = sum[0];
        odd_ = sum[1];
      } else {
        S& sum = row % 2 == 0 ? even_ : odd_;
        sum = sum + of_all_shapes;
      }
    }
    [[nodiscard]] S value() const noexcept { return even_ + odd_; }

   private:
    S even_{0.0}, odd_{0.0};
  };

  template <class Any>
  [[nodiscard, gnu::always_inline]] static auto& row_of(Any& words, [[maybe_unused]] std::size_t row) noexcept {
    if constexpr (alone) {
      return words;
    } else {
      return words[row];
    }
  }
  /// Numbers that all runs have in common.
  [[nodiscard, gnu::always_inline]] static Row numbers(const friction_curves::OfPeaks& of_peaks,
                                                       [[maybe_unused]] std::size_t row) noexcept {
    if constexpr (alone) {
      Row r;
      const auto* first = static_cast<const double*>(__builtin_assume_aligned(of_peaks.data(), sizeof(r.v[0])));
      for (std::size_t i = 0; i < std::size(r.v); ++i) std::memcpy(&r.v[i], first + 2 * i, sizeof(r.v[i]));
      return r;
    } else {
      return Row(of_peaks[row]);
    }
  }
  /// The delay of a row's curves: itself, or in lanes a copy that goes back by `keep`.
  [[nodiscard, gnu::always_inline]] static decltype(auto) delay_of(Members& m,
                                                                   [[maybe_unused]] std::size_t row) noexcept {
    if constexpr (alone) {
      return (m.phi);
    } else {
      const auto& d = m.phi;
      return ForceDelay<Row>{{{d.lags[0][row], d.lags[1][row], d.lags[2][row]}}, d.last[row], d.before[row]};
    }
  }
  [[gnu::always_inline]] static void keep([[maybe_unused]] Members& m, [[maybe_unused]] std::size_t row,
                                          [[maybe_unused]] const ForceDelay<Row>& delay) noexcept {
    if constexpr (!alone) {
      for (std::size_t i = 0; i < m.phi.lags.size(); ++i) m.phi.lags[i][row] = delay.lags.lag[i];
      m.phi.last[row] = delay.last;
      m.phi.before[row] = delay.before;
    }
  }
  [[nodiscard, gnu::always_inline]] static Row within(const Row& x, const Row& least, const Row& most) noexcept {
    return rig::smaller(rig::larger(x, least), most);
  }

  template <class Condition>
  void learn(const Look& look, Condition learns, Condition compares, std::size_t shape, Members& m) noexcept;
  template <class Condition>
  void follow_jump(const Condition& where, const S& dt_s, const S& residual_N) noexcept;
  void watch_for_jumps(const Data& data) noexcept;
  void summarise(const S& runaway_per_N) noexcept;

  FrictionBankOptions<S> options_{};
  S rate_Hz_{0.0};
  S quick_delay_s_{0.0};
  S theta_least_N_{0.0}, theta_most_N_{0.0}, theta_variance_least_N2_{0.0}, seen_N_{0.0};
  S last_dt_s_{0.0};
  S quick_covered_{0.0};  ///< of its distance, by the delay of the quick force in `last_dt_s_`
  Words prior_{};         ///< the same for all shapes
  std::array<Members, shapes> bank_{};
  ForceDelay<S> late_slip_{};
  S zero_least_{0.0}, zero_most_{0.0};
  S time_s_{0.0};
  S hold_s_{0.0};
  S unexplained_s_{0.0};
  S unexplained_N_{0.0};  ///< of the force of late
  S force_N_{0.0};
  S late_force_N_{0.0};
  S runaway_{0.0};
  S peak_slip_{0.0}, slip_zero_{0.0}, peak_force_N_{0.0};
  S jumps_{0.0};
};
using FrictionBank = BasicFrictionBank<double>;

}  // namespace abs_hil::control

#include "control/friction_bank_learning.hpp"
