# FindLCM: LCM::LCM (library) and the program lcm-gen as LCM_GEN_EXECUTABLE.
#
# LCM 1.5 and later have their own CMake configuration. This module uses it if it is installed. Debian 12's 1.3.1 has
# none, and its lcm.pc needs glib's, which liblcm-dev does not install. In that case the module looks for the files.

find_package(lcm CONFIG QUIET)
if(lcm_FOUND)
  set(LCM_LIBRARY lcm)
  if(NOT TARGET LCM::LCM)
    add_library(LCM::LCM INTERFACE IMPORTED)
    target_link_libraries(LCM::LCM INTERFACE lcm)
  endif()
  set(LCM_VERSION ${lcm_VERSION})
  get_target_property(LCM_INCLUDE_DIR lcm INTERFACE_INCLUDE_DIRECTORIES)
else()
  find_path(LCM_INCLUDE_DIR lcm/lcm.h)
  find_library(LCM_LIBRARY lcm)
  if(LCM_INCLUDE_DIR AND EXISTS ${LCM_INCLUDE_DIR}/lcm/lcm_version.h)
    file(STRINGS ${LCM_INCLUDE_DIR}/lcm/lcm_version.h _lcm_version_lines REGEX "#define LCM_[A-Z]+_VERSION")
    string(REGEX REPLACE ".*MAJOR_VERSION ([0-9]+).*MINOR_VERSION ([0-9]+).*MICRO_VERSION ([0-9]+).*" "\\1.\\2.\\3"
      LCM_VERSION "${_lcm_version_lines}")
  endif()
endif()
find_program(LCM_GEN_EXECUTABLE lcm-gen)

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(LCM
  REQUIRED_VARS LCM_LIBRARY LCM_INCLUDE_DIR LCM_GEN_EXECUTABLE
  VERSION_VAR LCM_VERSION
  REASON_FAILURE_MESSAGE "install liblcm-dev and liblcm-bin (scripts/setup.sh does)")

if(LCM_FOUND AND NOT TARGET LCM::LCM)
  add_library(LCM::LCM UNKNOWN IMPORTED)
  set_target_properties(LCM::LCM PROPERTIES
    IMPORTED_LOCATION ${LCM_LIBRARY}
    INTERFACE_INCLUDE_DIRECTORIES ${LCM_INCLUDE_DIR})
endif()
mark_as_advanced(LCM_INCLUDE_DIR LCM_LIBRARY LCM_GEN_EXECUTABLE)
