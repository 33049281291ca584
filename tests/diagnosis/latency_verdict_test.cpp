// How `abs_hil latency` grades jitter, missed ticks and full periods.
#include <nlohmann/json.hpp>

#include "catch.hpp"
#include "diagnosis/machine_facts.hpp"

using namespace abs_hil;
using namespace abs_hil::diagnosis;

namespace {
LatencyRun run(double worst_wakeup_us, double cycle_us = 10.0, std::uint64_t missed = 0) {
  LatencyRun r{.rate_Hz = 1000.0, .duration_s = 10.0, .cycles = 10'000 - missed, .realtime = true};
  r.timing.wakeup_latency = {5.0, 10.0, 15.0, worst_wakeup_us};
  r.timing.cycle_time = {cycle_us, cycle_us, cycle_us, cycle_us};
  r.timing.overruns.ticks_missed = missed;
  return r;
}
}  // namespace

TEST_CASE("jitter is graded by LinuxCNC's figures") {
  CHECK(judge(run(19.9)).jitter == Grade::very_good);
  CHECK(judge(run(20.0)).jitter == Grade::good);
  CHECK(judge(run(50.0)).jitter == Grade::good);
  CHECK(judge(run(50.1)).jitter == Grade::usable);
  CHECK(judge(run(500.0)).jitter == Grade::usable);
  CHECK(judge(run(500.1)).jitter == Grade::unfit);
}

TEST_CASE("missed ticks and a cycle that fills its period bring the verdict down") {
  CHECK(judge(run(10.0)).overall == Grade::very_good);
  CHECK(judge(run(10.0, 10.0, 1)).overall == Grade::usable);
  CHECK_THAT(judge(run(10.0, 10.0, 400)).in_time, Catch::Matchers::WithinAbs(0.96, 1e-12));
  CHECK(judge(run(10.0, 10.0, 501)).overall == Grade::unfit);
  CHECK_THAT(judge(run(10.0, 190.0)).left_for_control, Catch::Matchers::WithinAbs(0.8, 1e-12));
  CHECK(judge(run(10.0, 191.0)).overall == Grade::usable);
  CHECK(judge(run(10.0, 2'000.0)).overall == Grade::unfit);
}

TEST_CASE("a run that measured nothing is unfit, not good") {
  const Verdict verdict = judge(LatencyRun{.rate_Hz = 1000.0});
  CHECK(verdict.overall == Grade::unfit);
  CHECK(verdict.left_for_control == 0.0);
}

TEST_CASE("figures, verdict and machine stand side by side, as text and as JSON") {
  const MachineFacts facts{.kernel = "6.1-rt", .preemption = "PREEMPT_RT", .governor = "performance", .load_1min = 1.5};
  const std::string text = to_text(run(30.0), facts);
  for (const char* part : {"verdict: good", "6.1-rt, preemption PREEMPT_RT", "governor performance", "1.50"}) {
    CHECK(text.find(part) != std::string::npos);
  }
  CHECK(text.find("wire") == std::string::npos);
  LatencyRun over_network = run(30.0);
  over_network.wire = {.answers = 100, .mean_us = 58.25, .longest_us = 141.5};
  CHECK(to_text(over_network, facts).find("58.2 us on average, 141.5 us at most, 100 answers") != std::string::npos);
  CHECK(to_json(over_network, facts)["wire_us"] ==
        nlohmann::ordered_json{{"answers", 100}, {"mean", 58.25}, {"max", 141.5}});
  const auto json = to_json(run(30.0), facts);
  CHECK(json["wire_us"].is_null());
  CHECK(json["wakeup_latency_us"]["max"] == 30.0);
  CHECK(json["verdict"]["overall"] == "good");
  CHECK(json["machine"]["kernel"] == "6.1-rt");
}
