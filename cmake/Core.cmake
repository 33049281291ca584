# The simulation core: plant, controllers, gate, cycle, experiments, studies and their files, without network, terminal, guardian
# or real boards' helpers. It needs no library but zlib. It is what the Python module abs_hil._core is made of, on every
# platform. Of a room that has sources beyond the core (BEYOND_CORE, cmake/Room.cmake), it has the others.
#
# ABS_HIL_CORE_ONLY builds nothing else: rooms and Python module, with header-only libraries, for scripts/wheels.sh.
option(ABS_HIL_CORE_ONLY "Build the simulation core and its Python module alone, for wheels of any platform" OFF)

set(ABS_HIL_ROOMS_BEYOND_CORE cli emulator diagnosis guardian commands replay program)
