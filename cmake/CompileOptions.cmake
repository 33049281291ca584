# The warnings of all our targets; each is an error. Wheels are built by another compiler, whose warnings are others.
add_library(abs_hil_warnings INTERFACE)
if(NOT ABS_HIL_CORE_ONLY)
  target_compile_options(abs_hil_warnings INTERFACE -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror)
endif()

# No fused multiply-add that a source does not ask for: it would change the last bit, and so lanes of packs
# (rig/scalar.hpp) and single runs would part.
add_compile_options(-ffp-contract=off)

# For code beside the cycle, see cmake/Rooms.cmake.
add_library(abs_hil_beside_the_cycle INTERFACE)
target_compile_options(abs_hil_beside_the_cycle INTERFACE $<$<CONFIG:Release>:-O1>)

# GCC collects its garbage from 128 MB on, which takes a tenth of its time. Where there is memory for four jobs of 1.5 GB,
# it collects later.
cmake_host_system_information(RESULT ABS_HIL_MEMORY_MB QUERY TOTAL_PHYSICAL_MEMORY)
if(CMAKE_CXX_COMPILER_ID STREQUAL GNU AND ABS_HIL_MEMORY_MB GREATER 7500)
  add_compile_options(--param=ggc-min-heapsize=600000)
endif()
