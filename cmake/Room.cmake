# abs_hil_room(NAME SOURCES ... BEYOND_CORE ... USES ... PRIVATE ...): the library of one room of the table
# (cmake/Rooms.cmake). BEYOND_CORE names sources that do not belong to the simulation core (cmake/Core.cmake): they need the
# network, a terminal or a library that the core has not. USES names libraries that its headers need, PRIVATE ones that only
# its sources need, LIBRARIES_BEYOND_CORE ones that only those beyond the core need.
#
# Public headers stand in include/abs_hil/NAME and are included as "abs_hil/NAME/x.hpp"; the others stand beside their
# sources in src/NAME, of an extra in extras/NAME, and are included as "NAME/x.hpp". Each room has an include folder of its own that holds nothing
# but links to these two. A room's sources see its own and those of the rooms that it may know, and no others: rooms are
# linked privately, so what a known room knows is not seen.
include(Rooms)
include(Core)

option(ABS_HIL_UNITY "Compile the sources of a room together: half the time from scratch, more after a small change" ON)
set(ABS_HIL_ROOM_FOLDERS ${CMAKE_BINARY_DIR}/rooms)
include(CMakeDependentOption)
option(ABS_HIL_EXTRAS "Build the rooms of extras/, each of which has a switch of its own" ON)
foreach(room IN LISTS ABS_HIL_EXTRA_ROOMS)
  string(TOUPPER ABS_HIL_${room} switch)
  cmake_dependent_option(${switch} "Build the extra ${room}" ON ABS_HIL_EXTRAS OFF)
  if(NOT ${switch})
    list(APPEND ABS_HIL_ROOMS_LEFT_OUT ${room})
  endif()
endforeach()
set(room_lines "room\tholds\tmay know\n")
set(ABS_HIL_ROOM_NAMES)
foreach(row IN LISTS ABS_HIL_ROOM_TABLE)
  string(REPLACE " | " ";" row "${row} ")
  list(GET row 0 room)
  list(GET row 1 holds)
  list(GET row 2 knows)
  string(STRIP "${knows}" knows)
  string(APPEND room_lines "${room}\t${holds}\t${knows}\n")
  string(REPLACE " " ";" ABS_HIL_KNOWN_TO_${room} "${knows}")
  foreach(known IN LISTS ABS_HIL_KNOWN_TO_${room})
    if(NOT known IN_LIST ABS_HIL_ROOM_NAMES)
      message(FATAL_ERROR "cmake/Rooms.cmake: ${room} may not know ${known}, which does not stand above it")
    endif()
  endforeach()
  list(APPEND ABS_HIL_ROOM_NAMES ${room})
endforeach()
list(REMOVE_ITEM ABS_HIL_ROOM_NAMES ${ABS_HIL_ROOMS_LEFT_OUT})
file(WRITE ${CMAKE_BINARY_DIR}/rooms.tsv "${room_lines}")

# The folder of a room's sources.
function(abs_hil_room_sources result room)
  if(room IN_LIST ABS_HIL_EXTRA_ROOMS)
    set(${result} ${PROJECT_SOURCE_DIR}/extras/${room} PARENT_SCOPE)
  else()
    set(${result} ${PROJECT_SOURCE_DIR}/src/${room} PARENT_SCOPE)
  endif()
endfunction()

# Adds the libraries of all rooms of this build but those given.
macro(abs_hil_add_rooms)
  set(rooms_not_added ${ARGN})
  foreach(room IN LISTS ABS_HIL_ROOM_NAMES)
    if(room STREQUAL lcmtypes)
      add_subdirectory(lcmtypes)
    elseif(NOT room STREQUAL driver_sim AND NOT room IN_LIST rooms_not_added)  # driver_sim comes with driver
      abs_hil_room_sources(folder ${room})
      add_subdirectory(${folder})
    endif()
  endforeach()
endmacro()

# The include folder of one room.
function(abs_hil_room_folder room)
  set(folder ${ABS_HIL_ROOM_FOLDERS}/${room})
  file(MAKE_DIRECTORY ${folder}/abs_hil)
  abs_hil_room_sources(sources ${room})
  set(headers ${PROJECT_SOURCE_DIR}/include/abs_hil/${room})
  if(EXISTS ${sources})
    file(CREATE_LINK ${sources} ${folder}/${room} SYMBOLIC)
  endif()
  if(EXISTS ${headers})
    file(CREATE_LINK ${headers} ${folder}/abs_hil/${room} SYMBOLIC)
  endif()
endfunction()

# Compiles the sources beyond the core together, but never with one of the core: who links the core alone gets none of their
# objects, and so none of their libraries.
function(abs_hil_apart_from_core core beyond)
  if(NOT beyond)
    return()
  endif()
  set(place 0)
  foreach(source IN LISTS core)
    math(EXPR group "${place} / 12")
    set_source_files_properties(${source} PROPERTIES UNITY_GROUP core_${group})
    math(EXPR place "${place} + 1")
  endforeach()
  set_source_files_properties(${beyond} PROPERTIES UNITY_GROUP beyond_core)
  set(ABS_HIL_UNITY_MODE GROUP PARENT_SCOPE)
endfunction()

function(abs_hil_room name)
  set(ABS_HIL_UNITY_MODE BATCH)
  cmake_parse_arguments(ROOM "" "" "SOURCES;BEYOND_CORE;LIBRARIES_BEYOND_CORE;USES;PRIVATE" ${ARGN})
  if(NOT name IN_LIST ABS_HIL_ROOM_NAMES)
    message(FATAL_ERROR "cmake/Rooms.cmake has no room ${name}")
  endif()
  set(known ${ABS_HIL_KNOWN_TO_${name}})
  if(ABS_HIL_CORE_ONLY)
    set(ROOM_BEYOND_CORE)
    set(ROOM_LIBRARIES_BEYOND_CORE)
    list(REMOVE_ITEM known ${ABS_HIL_ROOMS_BEYOND_CORE})
  endif()
  list(TRANSFORM known PREPEND abs_hil_)
  abs_hil_room_folder(${name})
  set(folder $<BUILD_INTERFACE:${ABS_HIL_ROOM_FOLDERS}/${name}> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  if(ROOM_SOURCES)
    abs_hil_apart_from_core("${ROOM_SOURCES}" "${ROOM_BEYOND_CORE}")
    add_library(abs_hil_${name} STATIC ${ROOM_SOURCES} ${ROOM_BEYOND_CORE})
    target_link_libraries(abs_hil_${name} PUBLIC ${ROOM_USES}
      PRIVATE $<BUILD_INTERFACE:abs_hil_warnings> ${known} ${ROOM_PRIVATE} ${ROOM_LIBRARIES_BEYOND_CORE})
    target_include_directories(abs_hil_${name} PUBLIC ${folder})
    # Several sources at a time: most of a source's cost are the headers that its neighbours need as well.
    set_target_properties(abs_hil_${name} PROPERTIES UNITY_BUILD ${ABS_HIL_UNITY} UNITY_BUILD_BATCH_SIZE 12
      UNITY_BUILD_MODE ${ABS_HIL_UNITY_MODE})
    # The Python module is a shared object. Hidden symbols cost the same as without position-independent code.
    set_target_properties(abs_hil_${name} PROPERTIES POSITION_INDEPENDENT_CODE ON CXX_VISIBILITY_PRESET hidden
      VISIBILITY_INLINES_HIDDEN ON)
    if(name IN_LIST ABS_HIL_ROOMS_BESIDE_THE_CYCLE)
      target_link_libraries(abs_hil_${name} PRIVATE $<BUILD_INTERFACE:abs_hil_beside_the_cycle>)
    endif()
  else()
    add_library(abs_hil_${name} INTERFACE)
    target_link_libraries(abs_hil_${name} INTERFACE ${ROOM_USES})
    target_include_directories(abs_hil_${name} INTERFACE ${folder})
  endif()
  add_library(abs_hil::${name} ALIAS abs_hil_${name})
  # Installed, a room has the name that it has here: abs_hil::NAME (cmake/Install.cmake).
  set_target_properties(abs_hil_${name} PROPERTIES EXPORT_NAME ${name})
  set_property(GLOBAL APPEND PROPERTY ABS_HIL_ROOMS abs_hil_${name})
endfunction()

# Tests and benchmarks look into every room: the include folders of all, and nothing to link.
add_library(abs_hil_every_room INTERFACE)
list(TRANSFORM ABS_HIL_ROOM_NAMES PREPEND ${ABS_HIL_ROOM_FOLDERS}/ OUTPUT_VARIABLE every_room_folder)
target_include_directories(abs_hil_every_room INTERFACE ${every_room_folder})
target_link_libraries(abs_hil_every_room INTERFACE Eigen3::Eigen abs_hil_lcmtypes)
