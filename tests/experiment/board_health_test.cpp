#include "abs_hil/runtime/command_gate.hpp"
#include "catch.hpp"

using namespace abs_hil;
using rig::Reason;

TEST_CASE("What the board reports about itself becomes the fault's reason and value") {
  struct Row {
    rig::Measurement measurement;
    Reason reason;
    double value;
  };
  const Row row = GENERATE(values<Row>({
      {{.trip_flags = 1}, Reason::board_interlock_tripped, 1.0},
      {{.trip_flags = 2}, Reason::board_supply_tripped, 2.0},
      {{.trip_flags = 4}, Reason::board_interlock_tripped, 4.0},
      {{.trip_flags = 3}, Reason::board_interlock_tripped, 3.0},
      {{.supply_V = 11.9}, Reason::board_supply_low, 11.9},
      {{.supply_V = 12.0}, Reason::none, 0.0},
      {{.temperature_C = 80.1}, Reason::board_too_hot, 80.1},
      {{.temperature_C = 80.0}, Reason::none, 0.0},
      {{}, Reason::none, 0.0},  // NaN: the board cannot tell
      {{.supply_V = 0.0, .temperature_C = 200.0, .trip_flags = 2}, Reason::board_supply_tripped, 2.0},
  }));
  runtime::CommandGate gate({.supply_min_V = 12.0, .temperature_max_C = 80.0});
  gate.watch(row.measurement, 0);
  CHECK(gate.fault() == row.reason);
  CHECK(gate.fault_value() == row.value);
  const runtime::GateResult result = gate.check({.brake_duty = 0.5}, {});
  CHECK((result.command.brake_duty == 0.0) == (row.reason != Reason::none));
}
