# The table of rooms, the only one: name | what it holds | the rooms whose headers it may include (no semicolons). The
# libraries, their include folders, the check of includes (tests/rooms) and the table in docs/architecture.md are made
# from it. A room knows only rooms above it, so there is no circle.
set(ABS_HIL_ROOM_TABLE
  "version | what this build is: version, commit, compiler | "
  "rig | the vocabulary: measurement, command, parameters, brake map, tyre curve, cycle record, the tables of quantities, reasons and options' rows | "
  "files | the one writer of results: whole or not at all, and never in place of what is no regular file | rig"
  "cli | options and subcommands of a program as rows, the only source that includes CLI11 | rig"
  "control | the paper's laws, slip controllers, speed observer, brake actuator model, their options | rig"
  "plant_sim | the simulated wheels, tyre, brake, motor, encoders, roads, their options | rig"
  "driver | `RigDriver` and its lifecycle, backends (`driver/pci`, `driver/can`, `driver/usb`, `driver/hm2`) | rig"
  "driver_sim | the simulated backend (`driver/sim`) | rig driver plant_sim"
  "runtime | clocks, cyclic executive, command gate with its plausibility checks, rings, histograms, real-time set-up | rig driver"
  "experiment | sequence of phases, the logic of a run, commissioning | files rig control driver runtime"
  "lcmtypes | the message types, generated from `lcmtypes/*.lcm` | "
  "telemetry | LCM messages, event log, CSV, flight record, status line | files rig lcmtypes"
  "analysis | metrics, summary | rig"
  "run_folder | run folders: layout, environment, checksums, the index of a series | version files rig"
  "diagnosis | the checks of `abs_hil doctor`, the verdict of `abs_hil latency` | files rig driver runtime telemetry"
  "config | configuration keys from the option rows, files, experiment files: rows, reader, schema, plan, the merge to the settings of a run | files rig control plant_sim driver runtime experiment"
  "guardian | the guard of the outputs and its companions, the lease and the own guardian as a run sees them, the program abs_guardian | cli files rig control plant_sim driver runtime experiment lcmtypes telemetry config"
  "run | one run, put together from its settings in one place: driver, faults, plan, logic, gate, ring, metrics, in real time, in virtual time or cycle by cycle | files rig control plant_sim driver driver_sim runtime experiment analysis config"
  "program | what `abs_hil` decides between its command line and the other rooms | version cli files rig control plant_sim driver driver_sim runtime experiment lcmtypes telemetry analysis run_folder diagnosis config guardian run"
  # The extras (extras/): what a laboratory may leave out. No room above includes one.
  "injection | injected faults: a driver in front of any other that spoils what it reads and writes | version cli files rig control plant_sim driver driver_sim runtime experiment lcmtypes telemetry analysis run_folder diagnosis config guardian run program"
  "emulator | the device side of the boards, for tests and `abs_rig_emulator`, shares no line with the drivers | rig plant_sim"
  "study | simulated runs in this process: studies and their designs, chunks and folders, controllers side by side over varied plants | version cli files rig control plant_sim driver driver_sim runtime experiment lcmtypes telemetry analysis run_folder diagnosis config guardian run program"
  "commands | remote commands over LCM: authority, listener, sender | version cli files rig control plant_sim driver driver_sim runtime experiment lcmtypes telemetry analysis run_folder diagnosis config guardian run program"
  "replay | recorded runs through the cycle again: proof of equal commands, other controllers open loop | version cli files rig control plant_sim driver driver_sim runtime experiment lcmtypes telemetry analysis run_folder diagnosis config guardian run program"
  "interchange | what other tools bring or take: controllers from shared libraries, FMUs and agents, the process that runs them, plant and laws as FMUs | version cli files rig control plant_sim driver driver_sim runtime experiment lcmtypes telemetry analysis run_folder diagnosis config guardian run program"
)

# Rooms whose code neither runs in the cycle nor takes a noticeable time beside it. A release compiles them with -O1,
# which saves about a third of their compile time.
set(ABS_HIL_ROOMS_BESIDE_THE_CYCLE cli files emulator guardian analysis run_folder diagnosis config study commands replay interchange program)

# Rooms of extras/, each with a switch: -DABS_HIL_STUDY=OFF leaves one out, -DABS_HIL_EXTRAS=OFF all. One that knows the
# program has a part in it and defines an `Extra` (src/program/extra.hpp).
set(ABS_HIL_EXTRA_ROOMS injection emulator study commands replay interchange)
