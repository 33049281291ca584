// Metrics that a study defines for itself: one number made of a signal's values.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "abs_hil/rig/phase.hpp"
#include "abs_hil/rig/signals.hpp"
#include "config/script.hpp"
#include "rig/record_sink.hpp"

namespace abs_hil::study {

enum class Reduction : std::uint8_t { max, min, mean, rms, last };

/// A metric that a study defines: one number made of a signal's values in a phase.
struct SignalMetric {
  std::string name{};  ///< of its column in the results
  std::string of{};    ///< a column of a run's CSV, or a signal of the controller
  Reduction take{Reduction::max};
  rig::Phase phase{rig::Phase::brake};
  double after_s{0.0};    ///< only from this time after the phase's begin on
  double above_m_s{0.0};  ///< only while the car is faster
  config::Place place{};  ///< in the study's file
};

/// Computes such metrics from the records of a run.
class SignalMetrics final : public rig::RecordSink {
 public:
  /// @param signals  of the run's controller @param r2_m  the lower wheel's radius
  SignalMetrics(const std::vector<SignalMetric>& metrics, std::span<const rig::Signal> signals, double r2_m);

  void consume(const rig::CycleRecord& record, double distance_m) override;
  /// In the order of the metrics. NaN if no record counted or the controller has no such signal. Values that are NaN do
  /// not count.
  [[nodiscard]] std::vector<double> values() const;

 private:
  struct Running {
    SignalMetric metric{};
    std::size_t column{0};  ///< of the CSV, then of the controller's signals
    std::uint64_t count{0};
    double value{0.0};
    double begin_s{0.0};  ///< of the phase
    bool within{false};   ///< the last record was of the phase
  };

  double r2_m_;
  std::vector<Running> running_{};
};

}  // namespace abs_hil::study
