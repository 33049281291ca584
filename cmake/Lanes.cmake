# abs_hil_lane_sources(RESULT PREFIX [OTHER...]): the sources of many computations side by side (rig/pack.hpp), which are
# PREFIX_portable.cpp and, with ABS_HIL_WIDE_LANES, PREFIX_avx2.cpp and PREFIX_avx512.cpp, behind OTHER. Each must be compiled alone, so that
# no function of it stands in for another set's: tests/study/lanes/symbols_test.py. No source of ours uses -mfma's
# instructions; Eigen's headers ask for it. -O3 whatever the rest of the room has: a lane is all about speed.
option(ABS_HIL_WIDE_LANES "Compile the lanes for AVX2 and AVX-512, too" ON)
if(NOT CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|amd64|AMD64")
  set(ABS_HIL_WIDE_LANES OFF)
endif()
if(ABS_HIL_WIDE_LANES)
  add_compile_definitions(ABS_HIL_WIDE_LANES)
endif()

function(abs_hil_lane_sources result prefix)
  set(sources ${ARGN} ${prefix}_portable.cpp)
  if(ABS_HIL_WIDE_LANES)
    list(APPEND sources ${prefix}_avx2.cpp ${prefix}_avx512.cpp)
    set_source_files_properties(${prefix}_avx2.cpp PROPERTIES COMPILE_OPTIONS "-mavx2")
    set_source_files_properties(${prefix}_avx512.cpp PROPERTIES
      COMPILE_OPTIONS "-mavx2;-mfma;-mavx512f;-mavx512dq;-mavx512vl")
  endif()
  set_property(SOURCE ${sources} PROPERTY SKIP_UNITY_BUILD_INCLUSION ON)
  set_property(SOURCE ${sources} APPEND PROPERTY COMPILE_OPTIONS $<$<CONFIG:Release>:-O3>)
  set(${result} ${sources} PARENT_SCOPE)
endfunction()
