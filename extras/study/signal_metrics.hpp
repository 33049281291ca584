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

}  // namespace abs_hil::study

template <>
inline constexpr std::array<abs_hil::config::Word<abs_hil::study::Reduction>, 5>
    abs_hil::config::words_of<abs_hil::study::Reduction>{{{"max", study::Reduction::max},
                                                          {"min", study::Reduction::min},
                                                          {"mean", study::Reduction::mean},
                                                          {"rms", study::Reduction::rms},
                                                          {"last", study::Reduction::last}}};

namespace abs_hil::study {

/// A metric that a study defines, in a table of its file: one number made of a signal's values in a phase.
struct SignalMetric {
  ABS_HIL_OPTIONS(SignalMetric);
  static constexpr std::string_view title = "[[metric]]";
  static constexpr std::string_view meaning = "One number made of a signal's values in a phase";
  static constexpr std::array<std::string_view, 3> required{"name", "of", "take"};
  ABS_HIL_OPTION(std::string, name, {}, .meaning = "of its column in the results");
  ABS_HIL_OPTION(std::string, of, {}, .meaning = "a column of a run's CSV, or a controller's signal");
  ABS_HIL_OPTION(Reduction, take, Reduction::max, .meaning = "what is made of the values");
  ABS_HIL_OPTION(rig::Phase, phase, rig::Phase::brake, .meaning = "in which kind of phase; without: brake",
                 .allowed = {"accelerate", "coast", "brake", "hold", "stopped"});
  ABS_HIL_OPTION(double, after_s, 0.0, .key = "after", .unit = "s", .meaning = "from this time after its begin on",
                 .range = rig::from_zero(600));
  ABS_HIL_OPTION(double, above_m_s, 0.0, .key = "above", .unit = "m/s",
                 .meaning = "only while the car is faster than this", .range = rig::from_zero(200));
  config::Place place{};  ///< in the study's file

  void check(const config::TableReader& reader);
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
