# abs_hil_fuzz(NAME SOURCES ... USES ...): the fuzz target NAME, a program with LLVMFuzzerTestOneInput. Preset `asan`
# (clang) builds it with libFuzzer for scripts/fuzz.sh. Every other build makes a plain program, which runs the
# kept corpus, tests/fuzz/corpus/NAME, once. Its ctest entry is fuzz_corpus_NAME.
option(ABS_HIL_FUZZ "Build the fuzz targets with libFuzzer (needs clang)" OFF)

function(abs_hil_fuzz name)
  cmake_parse_arguments(FUZZ "" "" "SOURCES;USES" ${ARGN})
  add_executable(fuzz_${name} ${FUZZ_SOURCES})
  target_link_libraries(fuzz_${name} PRIVATE abs_hil_warnings abs_hil_every_room ${FUZZ_USES})
  set_target_properties(fuzz_${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/fuzz)
  if(ABS_HIL_FUZZ)
    target_link_options(fuzz_${name} PRIVATE -fsanitize=fuzzer)
    add_dependencies(abs_hil_fuzz_targets fuzz_${name})
  else()
    target_sources(fuzz_${name} PRIVATE ${PROJECT_SOURCE_DIR}/tests/fuzz/corpus_runner.cpp)
    add_test(NAME fuzz_corpus_${name}
      COMMAND fuzz_${name} ${PROJECT_SOURCE_DIR}/tests/fuzz/corpus/${name})
    if(TARGET abs_hil_quick_tests)
      add_dependencies(abs_hil_quick_tests fuzz_${name})
    endif()
  endif()
endfunction()

if(ABS_HIL_FUZZ)
  add_custom_target(abs_hil_fuzz_targets)
endif()
