#pragma once

#include <functional>
#include <string>
#include <utility>

#include "experiment/simulated_run.hpp"
#include "runtime/heartbeat.hpp"

namespace abs_hil::runtime::test {

/// Commits an offence in one cycle, to show that a proof would find it.
class PlantedLogic final : public CycleLogic {
 public:
  using Offence = void (*)();
  PlantedLogic(CycleLogic& inner, Offence offence, int in_cycle)
      : inner_(inner), offence_(offence), cycles_left_(in_cycle) {}

  void wheels_judged(bool sound) noexcept override { inner_.wheels_judged(sound); }
  [[nodiscard]] rig::Command step(const rig::Measurement& measurement, RunLatch& latch,
                                  rig::CycleRecord& record) noexcept override {
    if (offence_ != nullptr && cycles_left_-- == 0) offence_();
    return inner_.step(measurement, latch, record);
  }
  void commanded(const rig::Command& command) noexcept override { inner_.commanded(command); }
  [[nodiscard]] bool finished() const noexcept override { return inner_.finished(); }

 private:
  CycleLogic& inner_;
  Offence offence_;
  int cycles_left_;
};

/// The cycle of a whole experiment on the simulated rig, step by step, in one thread. It runs what the real-time thread
/// runs, including the gate's plausibility checks, the heartbeat and the flight recorder.
class CycleRun {
 public:
  static constexpr int offence_cycle = 500;

  CycleRun(Clock& clock, const std::string& controller, double rate_Hz, double start_speed_rad_s,
           PlantedLogic::Offence offence = nullptr)
      : setup_(setup(controller, rate_Hz, start_speed_rad_s)),
        driver_(setup_.plant, {.seed = 1, .start_speed_rad_s = start_speed_rad_s}),
        logic_(experiment::test::logic_parts(setup_)),
        planted_(logic_, offence, offence_cycle),
        gate_(logic_.make_gate(setup_.gate)),
        ring_(1024),  // full after so many cycles: dropping is part of what is proven
        slots_(FlightRing::slots_for(2.0, rate_Hz)),
        recorder_(slots_),
        heartbeat_(page_, guard_page_, recorder_, guardian_never_lost),
        executive_(clock, driver_, planted_, gate_, ring_, static_cast<std::int64_t>(1e9 / rate_Hz)) {
    executive_.set_watch(heartbeat_);
    driver_.configure();
    driver_.activate(clock.now_ns());
  }
  /// False after the run's last cycle.
  bool cycle() noexcept { return executive_.step(); }
  /// Number of heartbeats. The flight recorder keeps the record of each of these cycles.
  [[nodiscard]] std::uint64_t beats() const { return page_.cycle_beats.load(); }
  [[nodiscard]] std::uint64_t cycles() const { return executive_.statistics().cycles(); }
  [[nodiscard]] rig::Reason end_reason() const { return logic_.end_reason(); }

 private:
  /// Each cycle checks for a guardian that does not exist; the limit is never reached.
  static constexpr std::uint64_t guardian_never_lost = 1'000'000'000;

  static experiment::test::Setup setup(const std::string& controller, double rate_Hz, double start_speed_rad_s) {
    experiment::test::Setup s;
    s.control.controller = controller;
    s.control.rate_Hz = rate_Hz;
    s.experiment.start_speed_rad_s = start_speed_rad_s;
    return s;
  }

  experiment::test::Setup setup_;
  driver::SimDriver driver_;
  experiment::RunLogic logic_;
  PlantedLogic planted_;
  CommandGate gate_;
  RecordRing ring_;
  std::vector<FlightSlot> slots_;
  FlightRing recorder_;
  runtime::RunPage page_{};
  runtime::GuardPage guard_page_{};
  runtime::Heartbeat heartbeat_;
  CyclicExecutive executive_;
};

/// Every controller that `abs_hil list` shows.
inline std::vector<std::string> all_controllers() {
  std::vector<std::string> names;
  for (const auto& entry : control::controllers()) names.emplace_back(entry.name);
  return names;
}

}  // namespace abs_hil::runtime::test
