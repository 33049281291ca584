# The table of rooms, the only one: name | what it holds | the rooms whose headers it may include (no semicolons). The
# libraries, their include folders, the check of includes (tests/rooms) and the table in docs/architecture.md are made
# from it. A room knows only rooms above it, so there is no circle.
set(ABS_HIL_ROOM_TABLE
  "cli | options and subcommands of a program as rows, the only source that includes CLI11 | "
  "rig | the vocabulary: measurement, command, parameters, brake map, tyre curve, cycle record, the tables of quantities, reasons and options' rows | "
  "control | the paper's laws, slip controllers, speed observer, brake actuator model, their options | rig"
  "plant_sim | the simulated wheels, tyre, brake, motor, encoders, roads, their options | rig"
  "driver | `RigDriver` and its lifecycle, backends (`driver/pci`, `driver/can`, `driver/usb`), injected faults (`driver/injection`) | rig"
  "driver_sim | the simulated backend (`driver/sim`) | rig driver plant_sim"
  "emulator | the device side of the boards, for tests and `abs_rig_emulator`, shares no line with the drivers | rig plant_sim"
  "runtime | clocks, cyclic executive, command gate with its plausibility checks, rings, histograms, real-time set-up | rig driver"
  "guardian | the watchdog process beside a run: shared heartbeats, decisions, the process | rig driver runtime"
  "experiment | sequence of phases, the logic of a run, a run from start to safe state, commissioning | rig control driver runtime"
  "lcmtypes | the message types, generated from `lcmtypes/*.lcm` | "
  "telemetry | LCM messages, event log, CSV, flight record, status line | rig lcmtypes"
  "watch | `abs_hil watch`: the view of a running experiment, its screen, the terminal | rig telemetry lcmtypes"
  "analysis | metrics, summary | rig"
  "run_folder | run folders: layout, environment, checksums, the index of a series, the reader of a run's CSV | rig"
  "diagnosis | the checks of `abs_hil doctor`, the verdict of `abs_hil latency` | rig driver runtime telemetry"
  "config | configuration keys from the option rows, files, experiment files: grammar, parser, schema, plan | rig control plant_sim driver runtime guardian experiment"
  "study | simulated runs in this process: studies and their designs, chunks and folders, controllers side by side over varied plants | rig control plant_sim driver driver_sim runtime guardian experiment analysis run_folder config"
  "commands | remote commands over LCM: authority, listener, sender | rig control plant_sim driver runtime guardian experiment config telemetry lcmtypes"
  "replay | recorded runs through the cycle again: proof of equal commands, other controllers open loop | rig control plant_sim driver driver_sim runtime guardian experiment config telemetry lcmtypes"
  "interchange | what other tools bring or take: controllers from shared libraries and FMUs, the process that runs them, plant and laws as FMUs | rig control plant_sim driver driver_sim runtime experiment"
  "guardian_program | the program abs_guardian: the guardian of one run, the resident service, systemd and suspension | cli rig control plant_sim driver runtime guardian experiment lcmtypes telemetry config"
  "program | what `abs_hil` decides between its command line and the other rooms | cli rig control plant_sim driver driver_sim runtime guardian experiment lcmtypes telemetry watch analysis run_folder diagnosis config study commands replay interchange guardian_program"
)

# Rooms whose code neither runs in the cycle nor takes a noticeable time beside it. A release compiles them with -O1,
# which saves about a third of their compile time.
set(ABS_HIL_ROOMS_BESIDE_THE_CYCLE cli watch analysis run_folder diagnosis config study commands replay interchange guardian_program program)
