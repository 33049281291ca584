# `cpack` makes three Debian packages: abs-hil (programs), libabs-hil-dev (find_package(abs_hil)) and python3-abs-hil (the
# Python package, abs_report, abs_tune, abs_learn, abs_identify, abs_benchmark, abs_watch,
# abs_serve). scripts/package.sh builds and checks them.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_VENDOR "abs_hil")
set(ABS_HIL_MAINTAINER "The abs_hil authors <abs-hil@no-address.invalid>" CACHE STRING
  "Name and address of the maintainer of the Debian packages")
set(CPACK_PACKAGE_CONTACT ${ABS_HIL_MAINTAINER})
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_STRIP_FILES ON)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_COMPONENTS_ALL runtime development python)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_ENABLE_COMPONENT_DEPENDS OFF)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)

set(CPACK_DEBIAN_RUNTIME_PACKAGE_NAME abs-hil)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_SECTION science)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_DEPENDS "adduser")
set(CPACK_DEBIAN_RUNTIME_PACKAGE_RECOMMENDS "liblcm-bin, python3-abs-hil, fuse3")
set(CPACK_DEBIAN_RUNTIME_PACKAGE_SUGGESTS "libabs-hil-dev, liblcm-java, default-jre")
set(CPACK_DEBIAN_RUNTIME_DESCRIPTION
  "real-time driver and slip controller of an ABS rig
 Drives the Inteco ABS laboratory rig, or simulates it: starts the wheel,
 accelerates it, cuts the motor and brakes it to a stop under slip control
 in a real-time thread, and publishes every cycle over LCM.")
set(CPACK_DEBIAN_RUNTIME_PACKAGE_CONTROL_EXTRA
  ${PROJECT_SOURCE_DIR}/packaging/postinst ${PROJECT_SOURCE_DIR}/packaging/prerm ${PROJECT_SOURCE_DIR}/packaging/postrm)

set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libabs-hil-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
  "abs-hil (= ${PROJECT_VERSION}), libeigen3-dev, libboost-dev, liblcm-dev, liblcm-bin, libfmt-dev, libspdlog-dev, libtomlplusplus-dev, nlohmann-json3-dev, libcli11-dev, libssl-dev, libpugixml-dev, libzip-dev, libseccomp-dev, pkg-config")
set(CPACK_DEBIAN_DEVELOPMENT_DESCRIPTION
  "controllers and real-time loop of abs-hil as libraries
 Headers, static libraries and CMake configuration of abs-hil, for programs
 with their own slip controller.")

set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-abs-hil)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS
  "abs-hil (= ${PROJECT_VERSION}), python3 (>= 3.11), python3 (<< 3.12), python3-numpy, python3-pandas, python3-matplotlib, python3-jinja2, python3-scipy, python3-tqdm, python3-rich, python3-aiohttp")
set(CPACK_DEBIAN_PYTHON_DESCRIPTION
  "ABS rig in Python: simulation, reports, tuning, learning
 Simulates runs of the Inteco ABS laboratory rig with the program's own cycle,
 loads recorded runs, makes reports of them, and tunes or trains controllers.")

# Debian requires a compressed changelog and a copyright file in each package's documentation folder.
foreach(package abs-hil libabs-hil-dev python3-abs-hil)
  configure_file(packaging/changelog.Debian.in ${CMAKE_BINARY_DIR}/packaging/${package}/changelog @ONLY)
endforeach()
find_program(GZIP_EXECUTABLE gzip)
foreach(pair "abs-hil:runtime" "libabs-hil-dev:development" "python3-abs-hil:python")
  string(REPLACE ":" ";" pair "${pair}")
  list(GET pair 0 package)
  list(GET pair 1 component)
  execute_process(COMMAND ${GZIP_EXECUTABLE} -9nf changelog
    WORKING_DIRECTORY ${CMAKE_BINARY_DIR}/packaging/${package})
  install(FILES ${CMAKE_BINARY_DIR}/packaging/${package}/changelog.gz
    DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${package} RENAME changelog.gz COMPONENT ${component})
  install(FILES packaging/copyright DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${package} COMPONENT ${component})
endforeach()
include(CPack)
