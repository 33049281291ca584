// Any text as an experiment file: refused with a ConfigError in one line, or a script that can be explained, planned
// and run through a sequence without a number that is not finite.
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>

#include "config/config_error.hpp"
#include "config/plan.hpp"
#include "experiment/sequence.hpp"
#include "fuzz_input.hpp"
#include "runtime/run_latch.hpp"

namespace {

using namespace abs_hil;
using abs_hil::fuzz::expect;

void use(const config::Script& script) {
  config::Settings settings;
  config::apply(script, settings);
  static_cast<void>(config::explain(script, settings));
  const config::Plan plan = config::plan(script, settings);
  expect(!plan.phases.empty() && !plan.phases.front().name.empty());
  static_cast<void>(config::beyond_limits(plan, settings));
  experiment::Sequence sequence(plan.phases, plan.limits);
  runtime::RunLatch latch;
  for (int i = 0; i < 50; ++i) {
    sequence.update(
        {.time_s = i * 0.1, .speeds = {i * 10.0, i * 10.0}, .car_speed_m_s = i * 1.0, .distance_m = i * 0.5}, latch);
    const experiment::PhasePlan& now = sequence.current();
    const double time_s = sequence.phase_time_s();
    expect(now.motor_duty.at(time_s) >= 0.0 && now.motor_duty.at(time_s) <= 1.0);
    expect(std::isfinite(now.brake_torque_Nm.at(time_s)) && std::isfinite(now.brake_duty.at(time_s)));
    if (!now.slip_ref.empty()) expect(now.slip_ref.at(time_s) > 0.0 && now.slip_ref.at(time_s) < 1.0);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  const auto read_file = [](const std::string& name) -> std::optional<std::string> {
    if (name == "profile.csv") return "time_s,value\n0,0.1\n1,0.2\n";
    return std::nullopt;
  };
  try {
    use(config::parse(text, "fuzz.toml", read_file));
  } catch (const config::ConfigError& error) {
    const std::string message = error.what();
    expect(!message.empty() && message.find('\n') == std::string::npos);
  }
  return 0;
}
