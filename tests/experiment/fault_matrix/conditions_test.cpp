// Every fault again under slow reads, at three rates, and under wrong models: docs/fault-matrix-conditions.md.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <future>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "catch.hpp"
#include "experiment/injected_run.hpp"
#include "matrix.hpp"

using namespace abs_hil;
using namespace abs_hil::experiment;
using namespace abs_hil::experiment::test;

namespace {

/// What differs from the runs of docs/fault-matrix.md.
struct Conditions {
  std::string name;
  double rate_Hz{1000.0};
  double read_share{0.0};  ///< duration of each read as a part of the period
  double rig::WheelParameters::*wheel{nullptr};
  double rig::BrakeParameters::*brake{nullptr};
  double factor{1.0};  ///< of that parameter in the model
};

std::vector<Conditions> slow_reads_at(double rate_Hz) {
  std::vector<Conditions> all;
  for (const auto& [share, name] :
       std::map<double, std::string>{{0.4, "0.4"}, {0.55, "0.55"}, {0.7, "0.7"}, {0.95, "0.95"}}) {
    all.push_back({.name = name, .rate_Hz = rate_Hz, .read_share = share});
  }
  return all;
}

std::vector<Conditions> wrong_models() {
  using rig::BrakeParameters;
  using rig::WheelParameters;
  std::vector<Conditions> all;
  for (const double factor : {0.8, 1.2}) {
    const std::string by = factor < 1.0 ? " - 20 %" : " + 20 %";
    all.push_back({.name = "J1" + by, .wheel = &WheelParameters::J1_kg_m2, .factor = factor});
    all.push_back({.name = "J2" + by, .wheel = &WheelParameters::J2_kg_m2, .factor = factor});
    all.push_back({.name = "c31" + by, .brake = &BrakeParameters::c31_per_s, .factor = factor});
    all.push_back({.name = "b1" + by, .brake = &BrakeParameters::b1_Nm, .factor = factor});
  }
  return all;
}

constexpr double delay_s = 0.1;

struct Outcome {
  rig::Reason reason{rig::Reason::none};
  double after_s{0.0};    ///< from the fault to the end of the run
  double braking_s{0.0};  ///< from the start of braking to the end of the run; 0: it did not brake
  bool safe{false};
  bool stops{false};  ///< the car stood at the end, and the run says so
};

Outcome outcome_of(const driver::Injection& fault, const Conditions& c) {
  Setup setup;
  setup.control.rate_Hz = c.rate_Hz;
  if (fault.phase == rig::Phase::brake) setup.experiment.start_speed_rad_s = 170.0;
  setup.gate.supply_min_V = 15.0;
  setup.model = setup.plant.rig;
  if (c.wheel != nullptr) setup.model->wheels.*c.wheel *= c.factor;
  if (c.brake != nullptr) setup.model->brake.*c.brake *= c.factor;
  std::vector<driver::Injection> faults{fault};
  if (c.read_share > 0.0) faults.insert(faults.begin(), slow_reads(c.read_share, c.rate_Hz));
  const InjectedResult run = run_injected(setup, faults);
  const auto began = std::ranges::find_if(run.records, [&](const auto& r) { return r.phase == fault.phase; });
  const auto brake = std::ranges::find(run.records, rig::Phase::brake, &rig::CycleRecord::phase);
  const rig::CycleRecord& last = run.records.back();
  constexpr double stands_rad_s = 3.0;
  return {.reason = run.outcome.reason,
          .after_s = began == run.records.end() ? 0.0 : last.time_s - began->time_s - delay_s,
          .braking_s = brake == run.records.end() ? 0.0 : last.time_s - brake->time_s,
          .safe = run.outcome.safe_state.ok() && run.outputs.motor_duty == 0.0 && run.outputs.brake_duty == 0.0,
          .stops = std::abs(last.truth.speeds.omega2_rad_s) < stands_rad_s};
}

std::vector<driver::Injection> faults_in(rig::Phase phase) {
  std::vector<driver::Injection> all = all_injections(Backend::sim);
  std::erase_if(
      all, [phase](const driver::Injection& i) { return i.phase != phase || i.kind == driver::InjectionKind::ok; });
  return all;
}

/// One table: a row for each fault, a column for each of the conditions.
struct Table {
  std::string title;
  std::vector<Conditions> columns;
  std::vector<driver::Injection> faults;
  std::vector<std::vector<Outcome>> rows{};
};

Table filled(Table table) {
  for (const driver::Injection& fault : table.faults) {
    std::vector<Outcome>& row = table.rows.emplace_back();
    for (const Conditions& c : table.columns) row.push_back(outcome_of(fault, c));
  }
  return table;
}

const std::vector<Table>& tables() {
  static const std::vector<Table> all = [] {
    std::vector<std::future<Table>> coming;
    for (const rig::Phase phase : {rig::Phase::accelerate, rig::Phase::brake}) {
      const std::string in = ", faults in phase " + std::string(rig::name_of(phase));
      for (const auto& [rate_Hz, name] :
           std::map<double, std::string>{{100.0, "100 Hz"}, {1000.0, "1 kHz"}, {10'000.0, "10 kHz"}}) {
        coming.push_back(
            std::async(std::launch::async, filled, Table{name + in, slow_reads_at(rate_Hz), faults_in(phase)}));
      }
      coming.push_back(
          std::async(std::launch::async, filled, Table{"Wrong models" + in, wrong_models(), faults_in(phase)}));
    }
    std::vector<Table> done;
    for (auto& table : coming) done.push_back(table.get());
    return done;
  }();
  return all;
}

std::string page() {
  std::string text = R"(# Fault matrix under slow reads and wrong models

Do not edit: `scripts/fault_matrix.sh` writes this page from the runs of the test `fault_matrix_conditions` (label
`on-demand`), which fails if the page is out of date. Each fault of [fault-matrix.md](fault-matrix.md), from 0.1 s after
the start of its phase to the end of the run, in the simulated rig (adaptive, plant `paper-table1`, seed 1). Runs with
faults in phase `brake` begin with braking, at 170 rad/s.

The tables of rates have a column for the part of a period that each read takes. A fault of the signal `read` takes the
place of the slow reads. The tables of wrong models have a column for each parameter of the model that is wrong, at
1 kHz with reads that take no time. A cell has the reason of the stop ([reasons](fault-matrix.md#reasons)) and the time
from the fault to the safe state, ms; "–": the run went on to its end. All runs reached the safe state.
)";
  for (const Table& table : tables()) {
    text += "\n## " + table.title + "\n\n| fault |";
    for (const Conditions& c : table.columns) text += ' ' + c.name + " |";
    text += "\n|---|";
    for (std::size_t n = 0; n < table.columns.size(); ++n) text += "---|";
    for (std::size_t row = 0; row < table.rows.size(); ++row) {
      const driver::Injection& fault = table.faults[row];
      text.append("\n| `").append(driver::name_of(fault.signal)).append(":").append(driver::name_of(fault.kind));
      text += "` |";
      for (const Outcome& o : table.rows[row]) {
        const bool went_on = o.reason == rig::Reason::sequence_complete;
        text += went_on ? " – |"
                        : ' ' + std::to_string(static_cast<int>(o.reason)) + ", " +
                              std::to_string(std::lround(o.after_s * 1e3)) + " |";
      }
    }
    text += '\n';
  }
  return text;
}

/// What slow reads and long periods add to the bounds of docs/safety.md.
double allowed_s(const Expectation& expectation, const Conditions& c, rig::Reason reason) {
  constexpr double late_cycles = 50.0;
  constexpr double slow_reads_s = 0.3;
  constexpr double response_windows_s = 2.0;  // two windows of at most 1 s
  const bool by_response = reason == rig::Reason::speed_rises_with_motor_off ||
                           reason == rig::Reason::motor_no_response || reason == rig::Reason::brake_no_response ||
                           reason == rig::Reason::released_wheel_stands;
  // A late cycle takes two periods.
  return expectation.bound_s + slow_reads_s + 2.0 * late_cycles / c.rate_Hz + (by_response ? response_windows_s : 0.0);
}

/// Time since a fault began to matter: one of the brake does not before braking.
double mattered_s(const driver::Injection& fault, const Outcome& o) {
  const bool of_brake =
      fault.signal == driver::InjectionSignal::brake_pwm || fault.signal == driver::InjectionSignal::write;
  return of_brake && fault.phase != rig::Phase::brake ? std::min(o.after_s, o.braking_s) : o.after_s;
}

/// Delays of some ms are none where a period takes 10 ms.
bool no_delay(const driver::Injection& fault, const Conditions& c) {
  return fault.kind == driver::InjectionKind::slow && c.rate_Hz <= 100.0;
}

}  // namespace

TEST_CASE("under slow reads and wrong models every run ends safely, in time, and never with a false stop") {
  for (const Table& table : tables()) {
    for (std::size_t row = 0; row < table.rows.size(); ++row) {
      const Expectation expectation = expected(Backend::sim, table.faults[row]);
      for (std::size_t n = 0; n < table.columns.size(); ++n) {
        const Outcome& o = table.rows[row][n];
        CAPTURE(table.title, driver::to_text(table.faults[row]), table.columns[n].name, static_cast<int>(o.reason),
                o.after_s);
        CHECK(o.safe);
        if (o.reason == rig::Reason::sequence_complete) {
          CHECK(o.stops);
          CHECK((expectation.may_survive || no_delay(table.faults[row], table.columns[n])));
        } else {
          CHECK(rig::is_fault(o.reason));
          CHECK(mattered_s(table.faults[row], o) <= allowed_s(expectation, table.columns[n], o.reason));
        }
      }
    }
  }
}

TEST_CASE("docs/fault-matrix-conditions.md equals the result of the runs") {
  if (const char* file = std::getenv("ABS_HIL_WRITE_FAULT_MATRIX_CONDITIONS"); file != nullptr) {
    std::ofstream(file) << page();
    return;
  }
  std::ifstream stored(ABS_HIL_DOCS "/fault-matrix-conditions.md");
  std::stringstream content;
  content << stored.rdbuf();
  INFO("run scripts/fault_matrix.sh and look at what it changes");
  CHECK((content.str() == page()));
}
