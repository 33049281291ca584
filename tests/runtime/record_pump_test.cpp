// From the ring of records to all sinks; and the distance of a run.
#include "runtime/record_pump.hpp"

#include <stdexcept>
#include <vector>

#include "catch.hpp"

using namespace abs_hil;
using namespace abs_hil::runtime;

namespace {

class Sink final : public rig::RecordSink {
 public:
  void consume(const rig::CycleRecord& record, double distance_m) override {
    sequences.push_back(record.sequence);
    last_distance_m = distance_m;
  }
  void finish() override {
    finished = true;
    if (fails) throw std::runtime_error("disk full");
  }
  std::vector<std::uint64_t> sequences;
  double last_distance_m{0.0};
  bool finished{false};
  bool fails{false};
};

rig::CycleRecord braking_record(std::uint64_t sequence, double time_s, double omega2_rad_s) {
  rig::CycleRecord record;
  record.sequence = sequence;
  record.time_s = time_s;
  record.phase = rig::Phase::brake;
  record.truth.speeds = {0.0, omega2_rad_s};
  return record;
}

}  // namespace

TEST_CASE("every sink gets every record, in order") {
  RecordRing ring(8);
  Sink first, second;
  RecordPump pump(ring, 0.1, {&first, &second});
  for (std::uint64_t i = 0; i < 5; ++i) ring.push(braking_record(i, 0.0, 0.0));
  CHECK(pump.drain() == 5);
  CHECK(pump.drain() == 0);
  CHECK(first.sequences == std::vector<std::uint64_t>{0, 1, 2, 3, 4});
  CHECK(second.sequences == first.sequences);
  CHECK(pump.latest().sequence == 4);
}

TEST_CASE("the distance under constant deceleration equals the closed form; the trapezoidal rule is exact for it") {
  constexpr double r2_m = 0.099, start_rad_s = 170.0, slowing_rad_s2 = 75.0, dt_s = 1e-3;
  RecordRing ring(4096);
  Sink sink;
  RecordPump pump(ring, r2_m, {&sink});
  rig::CycleRecord before = braking_record(0, 0.0, start_rad_s);
  before.phase = rig::Phase::accelerate;  // does not count
  ring.push(before);
  constexpr int cycles = 2000;
  for (int i = 0; i <= cycles; ++i) {
    const double t_s = dt_s * i;
    ring.push(braking_record(static_cast<std::uint64_t>(i) + 1, 1.0 + t_s, start_rad_s - slowing_rad_s2 * t_s));
  }
  pump.drain();
  const double t_s = dt_s * cycles;
  CHECK_THAT(sink.last_distance_m,
             Catch::Matchers::WithinRel(r2_m * (start_rad_s * t_s - 0.5 * slowing_rad_s2 * t_s * t_s), 1e-9));
}

TEST_CASE("every sink is finished although one fails, and its exception is rethrown") {
  RecordRing ring(8);
  Sink failing, other;
  failing.fails = true;
  RecordPump pump(ring, 0.1, {&failing, &other});
  ring.push(braking_record(7, 0.0, 0.0));
  CHECK_THROWS_WITH(pump.finish(), "disk full");
  CHECK(other.finished);
  CHECK(other.sequences == std::vector<std::uint64_t>{7});
}
