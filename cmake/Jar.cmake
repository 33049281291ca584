# ABS_HIL_JAVA: true if jars can be built, that is with a JDK and LCM's own jar. Without them the build leaves out only
# lcm-spy's view of our messages.
# abs_hil_jar(NAME OUTPUT FILE SOURCES ... CLASSPATH JARS... [MANIFEST FILE]): compiles the sources into a jar. Its
# target is NAME_jar.

find_package(Java QUIET COMPONENTS Development)
get_filename_component(_lcm_bin ${LCM_GEN_EXECUTABLE} DIRECTORY)
find_file(LCM_JAR lcm.jar
  HINTS ${_lcm_bin}/../share/java
  PATHS /usr/local/share/java /usr/share/java
  DOC "LCM's Java library")
mark_as_advanced(LCM_JAR)

if(NOT DEFINED ABS_HIL_JAVA)
  set(ABS_HIL_JAVA OFF)
  if(NOT Java_JAVAC_EXECUTABLE OR NOT Java_JAR_EXECUTABLE)
    set(_missing "no JDK")
  elseif(NOT LCM_JAR)
    set(_missing "no lcm.jar")
  else()
    # The oldest Java release that the compiler supports, so that the jars run on any installed Java.
    file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/java_release/Probe.java "class Probe {}\n")
    foreach(release 8 11 17 21)
      execute_process(
        COMMAND ${Java_JAVAC_EXECUTABLE} --release ${release} -d ${CMAKE_CURRENT_BINARY_DIR}/java_release
          ${CMAKE_CURRENT_BINARY_DIR}/java_release/Probe.java
        RESULT_VARIABLE _failed OUTPUT_QUIET ERROR_QUIET)
      if(_failed EQUAL 0)
        set(ABS_HIL_JAVA_RELEASE ${release})
        set(ABS_HIL_JAVA ON)
        break()
      endif()
    endforeach()
    set(_missing "a JDK older than 9")
  endif()
  if(NOT ABS_HIL_JAVA)
    message(WARNING "${_missing}: no abs_hil_types.jar, and abs-spy will say so; scripts/setup.sh packages-spy.txt "
      "installs what is missing")
  endif()
endif()

function(abs_hil_jar name)
  cmake_parse_arguments(JAR "" "OUTPUT;MANIFEST" "SOURCES;CLASSPATH" ${ARGN})
  set(classes ${CMAKE_CURRENT_BINARY_DIR}/${name}_classes)
  get_filename_component(output_dir ${JAR_OUTPUT} DIRECTORY)
  list(JOIN JAR_CLASSPATH ":" classpath)
  set(create cf ${JAR_OUTPUT})
  if(JAR_MANIFEST)
    set(create cfm ${JAR_OUTPUT} ${JAR_MANIFEST})
  endif()
  add_custom_command(OUTPUT ${JAR_OUTPUT}
    COMMAND ${CMAKE_COMMAND} -E rm -rf ${classes}
    COMMAND ${CMAKE_COMMAND} -E make_directory ${classes} ${output_dir}
    # -options: no warning that support of old releases will end. -cast: lcm-gen casts the lengths of arrays.
    COMMAND ${Java_JAVAC_EXECUTABLE} --release ${ABS_HIL_JAVA_RELEASE} -Xlint:all,-options,-serial,-processing,-cast -Werror
      -encoding UTF-8 -cp ${classpath} -d ${classes} ${JAR_SOURCES}
    COMMAND ${Java_JAR_EXECUTABLE} ${create} -C ${classes} .
    DEPENDS ${JAR_SOURCES} ${JAR_CLASSPATH} ${JAR_MANIFEST}
    COMMENT "Building ${name}.jar"
    VERBATIM)
  add_custom_target(${name}_jar ALL DEPENDS ${JAR_OUTPUT})
endfunction()
