#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abs_hil/rig/parameters.hpp"
#include "rig/record_sink.hpp"

namespace abs_hil::analysis {

/// One point of a friction curve.
struct FrictionPoint {
  double time_s{0.0};
  double slip{0.0};
  double force_N{0.0};
};

/// The tyre's friction curve over the slip range of a run, and its peak. NaN if the run did not pass a peak.
struct FrictionCurveResult {
  std::vector<FrictionPoint> points{};
  double peak_force_N{rig::unknown};
  double peak_slip{rig::unknown};
};

/// One reading of both encoders.
struct EncoderSample {
  double time_s;       ///< since any moment
  std::int64_t upper;  ///< counts, unwrapped
  std::int64_t lower;
};
inline constexpr double friction_half_window_s = 0.03;

/// The point in the middle of a window of samples, which reaches over friction_half_window_s on either side; nothing if
/// it has too few of them, or the lower wheel is too slow for a slip.
/// @param middle  time and counts that the cubics count from
[[nodiscard]] std::optional<FrictionPoint> friction_point(std::span<const EncoderSample> window,
                                                          const EncoderSample& middle,
                                                          const rig::WheelParameters& wheels, double rad_per_count);

/// Traces the friction curve over phase `brake` from the counts of both encoders and their reading times alone:
///   force = -(J2 omega2' + d2 omega2 + M20) / r2  (2),   slip (5) from both speeds.
/// Speeds and deceleration come from least-squares cubics through the counts within 30 ms on either side. These have no
/// lag, unlike a filter in the cycle. The method assumes nothing about the tyre; wheel parameters are the controller's.
/// The peak is that of a cubic in ln(slip) through the points above 85 % of the largest force.
class FrictionCurve final : public rig::RecordSink {
 public:
  FrictionCurve(const rig::WheelParameters& wheels, std::int32_t counts_per_rev);

  void consume(const rig::CycleRecord& record, double distance_m) override;
  [[nodiscard]] FrictionCurveResult result() const;

 private:
  rig::WheelParameters wheels_;
  double rad_per_count_;
  std::vector<EncoderSample> samples_;  ///< times since the first one
  std::int64_t start_ns_{0};
  std::int32_t last_upper_{0};
  std::int32_t last_lower_{0};
};

/// As CSV: time_s,slip,force_N.
[[nodiscard]] std::string to_csv(const FrictionCurveResult& result);
/// Fields of a run's summary: peak_force_N, peak_slip, points.
[[nodiscard]] nlohmann::ordered_json to_json(const FrictionCurveResult& result);

}  // namespace abs_hil::analysis
