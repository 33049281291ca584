# abs_hil_room(NAME SOURCES ... KNOWS ... USES ... PRIVATE ...): the library of one room. KNOWS names the rooms that it
# may include, USES the other libraries that its public headers need, PRIVATE the libraries that only its sources need.
function(abs_hil_room name)
  cmake_parse_arguments(ROOM "" "" "SOURCES;KNOWS;USES;PRIVATE" ${ARGN})
  if(ROOM_SOURCES)
    add_library(abs_hil_${name} STATIC ${ROOM_SOURCES})
    set(scope PUBLIC)
    target_link_libraries(abs_hil_${name} PRIVATE $<BUILD_INTERFACE:abs_hil_warnings> ${ROOM_PRIVATE})
  else()
    add_library(abs_hil_${name} INTERFACE)
    set(scope INTERFACE)
  endif()
  add_library(abs_hil::${name} ALIAS abs_hil_${name})
  target_include_directories(abs_hil_${name} ${scope}
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  list(TRANSFORM ROOM_KNOWS PREPEND abs_hil_)
  target_link_libraries(abs_hil_${name} ${scope} ${ROOM_KNOWS} ${ROOM_USES})
  # An installed room keeps its name: abs_hil::NAME (cmake/Install.cmake).
  set_target_properties(abs_hil_${name} PROPERTIES EXPORT_NAME ${name})
  set_property(GLOBAL APPEND PROPERTY ABS_HIL_ROOMS abs_hil_${name})
endfunction()
