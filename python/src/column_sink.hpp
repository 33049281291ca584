#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "abs_hil/rig/quantities.hpp"
#include "array.hpp"
#include "bindings.hpp"
#include "rig/record_sink.hpp"
#include "rig/run_names.hpp"

namespace abs_hil::python {

/// Keeps the columns of a run's CSV. A phase is its number.
class ColumnSink final : public rig::RecordSink {
 public:
  void consume(const rig::CycleRecord& record, double distance_m) override {
    constexpr std::int64_t no_message = 0;
    const rig::CycleParts<const rig::CycleRecord> parts{record, distance_m, no_message};
    std::size_t column = 0;
    rig::for_each_quantity([&](const auto& row) {
      if (row.in_csv()) columns_[column++].push_back(static_cast<double>(row.at(parts)));
    });
    phases_.emplace_back(record.phase, record.phase_index);
    for (std::size_t n = 0; n < rig::signal_max; ++n) signals_[n].push_back(record.control.signals[n]);
  }
  [[nodiscard]] std::size_t rows() const noexcept { return columns_.front().size(); }
  /// Name to array, in the order of the CSV; `phase_name` is a list of texts, and missing if the experiment has no
  /// names of its own.
  [[nodiscard]] py::dict take(const rig::RunNames& names) {
    py::dict taken;
    for (std::size_t n = 0; n < columns_.size(); ++n) {
      taken[py::str(rig::csv_columns[n].data(), rig::csv_columns[n].size())] = array_of(std::move(columns_[n]));
    }
    if (names.has_own_phase_names()) taken["phase_name"] = phase_names(names);
    for (std::size_t n = 0; n < names.signals.size(); ++n) {
      taken[py::str(names.signals[n])] = array_of(std::move(signals_[n]));
    }
    return taken;
  }

 private:
  [[nodiscard]] py::list phase_names(const rig::RunNames& names) const {
    py::list all(phases_.size());
    py::object text;
    for (std::size_t n = 0; n < phases_.size(); ++n) {
      if (n == 0 || phases_[n] != phases_[n - 1]) {
        rig::CycleRecord record;
        std::tie(record.phase, record.phase_index) = phases_[n];
        text = py::str(std::string(names.phase_of(record)));
      }
      all[n] = text;
    }
    return all;
  }

  std::array<std::vector<double>, rig::csv_columns.size()> columns_{};
  std::array<std::vector<double>, rig::signal_max> signals_{};
  std::vector<std::pair<rig::Phase, std::uint16_t>> phases_{};
};

}  // namespace abs_hil::python
