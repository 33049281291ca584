#pragma once

#include <cmath>
#include <cstdint>

#include "rig/record_sink.hpp"

namespace abs_hil::analysis {

/// Car speed above which slip and its estimates are judged: below, a count of an encoder is a large part of them.
inline constexpr double least_judged_speed_m_s = 3.0;

/// What a braking run was worth. NaN where a run does not get that far or the backend cannot know. Speeds and slip are
/// the true ones where the backend knows them, else the estimates.
struct Metrics {
  double brake_start_s{rig::unknown};     ///< first cycle in phase brake
  double stop_time_s{rig::unknown};       ///< from there to the first tick with v_x below the end speed
  double stop_distance_m{rig::unknown};   ///< trapezoid of v_x over the ticks between
  double slip_rms{rig::unknown};          ///< of slip - slip_ref, later than 0.3 s after brake start and v_x > 3 m/s
  double slip_settling_s{rig::unknown};   ///< after which slip stays within 0.02 of slip_ref while v_x > 3 m/s
  double theta_final_N{rig::unknown};     ///< last estimate while v_x > 3 m/s
  double theta_settling_s{rig::unknown};  ///< after which the estimate stays within 5 % of the truth while v_x > 3 m/s
  double torque_total_variation_Nm{rig::unknown};  ///< of the torque asked for, over phase brake: measures chatter
  double slip_overshoot{rig::unknown};     ///< most that slip exceeds slip_ref by while v_x > 3 m/s; 0 if it never does
  double time_locked_s{rig::unknown};      ///< time braked with slip > 0.95 while v_x > 3 m/s
  double theta_error_final{rig::unknown};  ///< theta_final_N over the true theta then, less 1
  double theta_error_rms{rig::unknown};    ///< of the estimate over the truth less 1, where slip_rms looks
};

/// Computes the metrics from the records as they come, without storing them.
class RunMetrics final : public rig::RecordSink {
 public:
  /// @param r2_m lower wheel's radius
  /// @param end_speed_m_s v_x at which the car counts as stopped, > 0
  RunMetrics(double r2_m, double end_speed_m_s) : r2_m_(r2_m), end_speed_m_s_(end_speed_m_s) {}

  void consume(const rig::CycleRecord& record, double distance_m) override;
  [[nodiscard]] Metrics metrics() const;
  /// True once the stop is known and braking is over: no later record changes a metric.
  [[nodiscard]] bool complete() const noexcept { return !braking_ && !std::isnan(metrics_.stop_time_s); }

 private:
  /// Since when a quantity has stayed within its band, counted from the start of braking.
  class Settling {
   public:
    void observe(double since_brake_s, bool inside) noexcept {
      if (inside && !settled_) since_s_ = since_brake_s;
      settled_ = inside;
    }
    [[nodiscard]] double since_s() const noexcept { return settled_ ? since_s_ : rig::unknown; }

   private:
    bool settled_{false};
    double since_s_{rig::unknown};
  };

  void consume_braking(const rig::CycleRecord& record, double since_brake_s, double v_x_m_s);

  double r2_m_;
  double end_speed_m_s_;
  Metrics metrics_{};
  Settling slip_settling_{};
  Settling theta_settling_{};
  double slip_square_sum_{0.0};
  double theta_square_sum_{0.0};
  std::uint64_t slip_samples_{0};
  bool braking_{false};
  double last_time_s_{rig::unknown};
  double last_torque_Nm_{rig::unknown};
};

}  // namespace abs_hil::analysis
