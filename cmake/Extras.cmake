# The list of extras that the program abs_hil has: a source made here, so that no file of src names one.
set(extras_built)
set(extra_declarations)
set(extra_rows)
foreach(room IN LISTS ABS_HIL_EXTRA_ROOMS)
  if(room IN_LIST ABS_HIL_ROOM_NAMES AND program IN_LIST ABS_HIL_KNOWN_TO_${room})
    list(APPEND extras_built abs_hil_${room})
    string(APPEND extra_declarations "extern const Extra ${room}_extra;\n")
    list(APPEND extra_rows "&${room}_extra")
  endif()
endforeach()
list(LENGTH extras_built extra_count)
list(JOIN extra_rows ", " extra_rows)
file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/extras.cpp CONTENT [[
// Made by cmake/Extras.cmake.
#include <array>

#include "program/extra.hpp"

namespace abs_hil::program {

@extra_declarations@
std::span<const Extra* const> extras() noexcept {
  static constexpr std::array<const Extra*, @extra_count@> all{@extra_rows@};
  return all;
}

}  // namespace abs_hil::program
]] @ONLY)
add_library(abs_hil_extras STATIC ${CMAKE_BINARY_DIR}/extras.cpp)
list(TRANSFORM ABS_HIL_KNOWN_TO_program PREPEND abs_hil_ OUTPUT_VARIABLE known_to_program)
target_link_libraries(abs_hil_extras PRIVATE abs_hil_program ${known_to_program} ${extras_built} nlohmann_json::nlohmann_json)
set_target_properties(abs_hil_extras PROPERTIES EXPORT_NAME extras)
set_property(GLOBAL APPEND PROPERTY ABS_HIL_ROOMS abs_hil_extras)
# The program calls extras(), and each extra uses the program: static libraries may name each other.
target_link_libraries(abs_hil_program PRIVATE abs_hil_extras)
