# What `cmake --install` installs, and where. There are two components: runtime (programs, configuration) and
# development (headers, libraries, find_package(abs_hil)).
include(CMakePackageConfigHelpers)

set(abs_hil_cmake_dir ${CMAKE_INSTALL_LIBDIR}/cmake/abs_hil)

# Programs and what they need.
set(programs abs_hil_command)
foreach(optional abs_rig_emulator abs_guardian)
  if(TARGET ${optional})
    list(APPEND programs ${optional})
  endif()
endforeach()
install(TARGETS ${programs} abs_hil_executable RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT runtime)
# Nobody calls it by hand.
if(TARGET abs_controller_host)
  install(TARGETS abs_controller_host RUNTIME DESTINATION ${CMAKE_INSTALL_LIBDIR}/abs_hil COMPONENT runtime)
endif()
install(DIRECTORY config/ DESTINATION ${CMAKE_INSTALL_DATADIR}/abs_hil/config COMPONENT runtime PATTERN udev EXCLUDE)
install(FILES config/udev/70-abs-hil.rules DESTINATION ${ABS_HIL_UDEV_DIR} COMPONENT runtime)
install(FILES packaging/guardian.toml DESTINATION ${CMAKE_INSTALL_DATADIR}/abs_hil COMPONENT runtime)
install(DIRECTORY packaging/systemd/ DESTINATION ${ABS_HIL_SYSTEMD_DIR} COMPONENT runtime)
install(FILES packaging/abs_hil.sysusers DESTINATION ${ABS_HIL_SYSUSERS_DIR} RENAME abs_hil.conf COMPONENT runtime)
install(FILES README.md CHANGELOG.md CITATION.cff DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT runtime)
install(DIRECTORY docs DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT runtime)

# help2man makes the manual pages from the programs' --help, so they are always up to date.
find_program(HELP2MAN_EXECUTABLE help2man)
if(HELP2MAN_EXECUTABLE)
  set(manual_pages)
  foreach(program ${programs})
    get_target_property(output_name ${program} OUTPUT_NAME)
    if(NOT output_name)
      set(output_name ${program})
    endif()
    set(page ${CMAKE_BINARY_DIR}/man/${output_name}.1)
    add_custom_command(OUTPUT ${page}.gz
      COMMAND ${CMAKE_COMMAND} -E make_directory ${CMAKE_BINARY_DIR}/man
      COMMAND ${HELP2MAN_EXECUTABLE} --no-info --version-string ${PROJECT_VERSION} --source "abs_hil ${PROJECT_VERSION}"
        --include ${PROJECT_SOURCE_DIR}/packaging/${output_name}.h2m --output ${page} $<TARGET_FILE:${program}>
      COMMAND gzip -9nf ${page}
      DEPENDS ${program} abs_hil_executable ${PROJECT_SOURCE_DIR}/packaging/${output_name}.h2m
      VERBATIM)
    list(APPEND manual_pages ${page}.gz)
  endforeach()
  set(python_pages)
  if(ABS_HIL_PYTHON AND NOT SKBUILD)
    foreach(program abs_report abs_tune abs_learn abs_identify abs_benchmark abs_convert abs_watch abs_export-fmu abs_serve
            abs_lab abs_log abs_rig)
      set(page ${CMAKE_BINARY_DIR}/man/${program}.1)
      add_custom_command(OUTPUT ${page}.gz
        COMMAND ${CMAKE_COMMAND} -E make_directory ${CMAKE_BINARY_DIR}/man
        COMMAND ${HELP2MAN_EXECUTABLE} --no-info --version-string ${PROJECT_VERSION} --source "abs_hil ${PROJECT_VERSION}"
          --include ${PROJECT_SOURCE_DIR}/packaging/${program}.h2m --output ${page}
          ${CMAKE_RUNTIME_OUTPUT_DIRECTORY}/${program}
        COMMAND gzip -9nf ${page}
        DEPENDS abs_hil_python ${PROJECT_SOURCE_DIR}/packaging/${program}.h2m
        VERBATIM)
      list(APPEND python_pages ${page}.gz)
    endforeach()
  endif()
  add_custom_target(abs_hil_manual_pages ALL DEPENDS ${manual_pages} ${python_pages})
  install(FILES ${manual_pages} DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT runtime)
  install(FILES ${python_pages} DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT python)
else()
  message(STATUS "help2man is not installed: no manual pages")
endif()

# Tab completion, from the programs' --help, too.
if(ABS_HIL_PYTHON AND NOT SKBUILD)
  set(completion ${CMAKE_BINARY_DIR}/completion)
  add_custom_command(OUTPUT ${completion}/zsh/_abs_hil
    COMMAND ${Python3_EXECUTABLE} ${PROJECT_SOURCE_DIR}/scripts/completion.py ${completion} ${CMAKE_RUNTIME_OUTPUT_DIRECTORY}
    DEPENDS ${programs} abs_hil_executable abs_hil_python ${PROJECT_SOURCE_DIR}/scripts/completion.py VERBATIM)
  add_custom_target(abs_hil_completion ALL DEPENDS ${completion}/zsh/_abs_hil)
  install(DIRECTORY ${completion}/bash/ DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT runtime)
  install(DIRECTORY ${completion}/zsh/ DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions COMPONENT runtime)
  install(DIRECTORY ${completion}/fish/ DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d COMPONENT runtime)
endif()

# The rooms as libraries, for programs with their own controller.
get_property(abs_hil_rooms GLOBAL PROPERTY ABS_HIL_ROOMS)
install(TARGETS ${abs_hil_rooms} EXPORT abs_hil_targets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}/abs_hil COMPONENT development)
install(EXPORT abs_hil_targets NAMESPACE abs_hil:: DESTINATION ${abs_hil_cmake_dir} COMPONENT development)
install(DIRECTORY include/abs_hil DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT development)
install(DIRECTORY lcmtypes/ DESTINATION ${CMAKE_INSTALL_DATADIR}/abs_hil/lcmtypes COMPONENT development
  FILES_MATCHING PATTERN *.lcm)
configure_package_config_file(packaging/abs_hilConfig.cmake.in ${CMAKE_BINARY_DIR}/abs_hilConfig.cmake
  INSTALL_DESTINATION ${abs_hil_cmake_dir})
write_basic_package_version_file(${CMAKE_BINARY_DIR}/abs_hilConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/abs_hilConfig.cmake ${CMAKE_BINARY_DIR}/abs_hilConfigVersion.cmake cmake/FindLCM.cmake
  DESTINATION ${abs_hil_cmake_dir} COMPONENT development)

# Builds what `cmake --install` needs: the programs with their pages and modules, without tests and benchmarks.
add_custom_target(abs_hil_installed)
foreach(target abs_hil_programs abs_hil_manual_pages abs_hil_completion abs_hil_python abs_hil_types_jar)
  if(TARGET ${target})
    add_dependencies(abs_hil_installed ${target})
  endif()
endforeach()
