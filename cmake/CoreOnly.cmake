# The simulation core alone (ABS_HIL_CORE_ONLY, cmake/Core.cmake), for any platform that the compiler makes programs for:
# its rooms, the library of the exported FMUs, and a Python module for each Python; for WebAssembly the module of `abs_hil lab`.
#
# ABS_HIL_SYSTEM_INCLUDE  where the headers of the header-only libraries are (/usr/include)
# ABS_HIL_ZLIB_SOURCES    folder of zlib's sources
# ABS_HIL_PYTHON_MODULES  a list of FILE|HEADERS[|LIBRARY]: file name of the module for one Python, that Python's headers, and
#                         what it is linked with, which Windows alone needs
set(ABS_HIL_SYSTEM_INCLUDE /usr/include CACHE PATH "Where the headers of Boost, Eigen, fmt and so on are")
set(ABS_HIL_ZLIB_SOURCES "" CACHE PATH "Folder of zlib's sources")
set(ABS_HIL_PYTHON_MODULES "" CACHE STRING "File name, headers and library of each Python module")
set(ABS_HIL_PYBIND11_INCLUDE "" CACHE PATH "Headers of pybind11")
set(ABS_HIL_JAVA OFF)

# Links to the libraries' headers: those of this system's C library beside them are not the platform's.
set(headers ${CMAKE_BINARY_DIR}/headers)
file(MAKE_DIRECTORY ${headers})
set(libraries boost fmt spdlog toml++ nlohmann lcm eigen3/Eigen eigen3/unsupported)
if(CMAKE_SYSTEM_PROCESSOR STREQUAL wasm32)
  list(APPEND libraries simde)
endif()
foreach(library IN LISTS libraries)
  get_filename_component(name ${library} NAME)
  if(NOT EXISTS ${ABS_HIL_SYSTEM_INCLUDE}/${library})
    message(FATAL_ERROR "${ABS_HIL_SYSTEM_INCLUDE}/${library} is missing: scripts/setup.sh installs it")
  endif()
  file(CREATE_LINK ${ABS_HIL_SYSTEM_INCLUDE}/${library} ${headers}/${name} SYMBOLIC)
endforeach()
find_program(LCM_GEN_EXECUTABLE lcm-gen REQUIRED)

# abs_hil_headers_only(TARGET DEFINITION...)
function(abs_hil_headers_only target)
  add_library(${target} INTERFACE IMPORTED GLOBAL)
  target_include_directories(${target} SYSTEM INTERFACE ${headers})
  target_compile_definitions(${target} INTERFACE ${ARGN})
endfunction()
# Boost 1.74 uses a base class that C++17 has removed and that the library of clang gives on demand only.
abs_hil_headers_only(Boost::headers _LIBCPP_ENABLE_CXX17_REMOVED_UNARY_BINARY_FUNCTION)
# Eigen takes clang for an old GCC on Windows, by this number, and wraps its vectors in a way that AVX-512 does not compile with.
abs_hil_headers_only(Eigen3::Eigen $<$<BOOL:${WIN32}>:__GXX_ABI_VERSION=1016>)
# On ARM it multiplies and adds in one rounding where the processor can, which changes the last bit. The compiler's own header
# needs to know that the processor can, so it comes first.
if(CMAKE_SYSTEM_PROCESSOR MATCHES "aarch64|arm64")
  file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/no_fused_eigen.hpp CONTENT "#include <arm_neon.h>\n#undef __ARM_FEATURE_FMA\n")
  target_compile_options(Eigen3::Eigen INTERFACE "SHELL:-include ${CMAKE_BINARY_DIR}/no_fused_eigen.hpp")
endif()
abs_hil_headers_only(LCM::LCM)
abs_hil_headers_only(fmt::fmt FMT_HEADER_ONLY=1)
abs_hil_headers_only(nlohmann_json::nlohmann_json)
abs_hil_headers_only(spdlog::spdlog FMT_HEADER_ONLY=1 SPDLOG_FMT_EXTERNAL=1)
abs_hil_headers_only(tomlplusplus::tomlplusplus TOML_HEADER_ONLY=1)

if(CMAKE_SYSTEM_PROCESSOR STREQUAL wasm32)  # of a page (scripts/lab.sh), which reads no compressed files
  add_library(ZLIB::ZLIB INTERFACE IMPORTED GLOBAL)
else()
  file(GLOB zlib_sources ${ABS_HIL_ZLIB_SOURCES}/*.c)
  if(NOT zlib_sources)
    message(FATAL_ERROR "ABS_HIL_ZLIB_SOURCES=\"${ABS_HIL_ZLIB_SOURCES}\" holds no sources of zlib")
  endif()
  list(FILTER zlib_sources EXCLUDE REGEX "/gz[a-z]*\\.c$")  # its own files, which need more of the system
  add_library(abs_hil_zlib STATIC ${zlib_sources})
  target_include_directories(abs_hil_zlib SYSTEM PUBLIC ${ABS_HIL_ZLIB_SOURCES})
  set_target_properties(abs_hil_zlib PROPERTIES POSITION_INDEPENDENT_CODE ON C_VISIBILITY_PRESET hidden)
  add_library(ZLIB::ZLIB ALIAS abs_hil_zlib)
endif()

# zig writes facts for debuggers unless it is told not to. Without them the module is a twentieth as large.
add_compile_options(-g0)
add_link_options(-s)
# Of zig's headers for macOS, <cmath> and <cfloat> take each other's numbers away, whichever comes first, but not here.
if(APPLE)
  set(CMAKE_CXX_EXTENSIONS ON)
  add_compile_options("$<$<COMPILE_LANGUAGE:CXX>:SHELL:-include cfloat>")
  # zig's linker crashes over a bundle of this size; Python takes a library as well.
  set(CMAKE_SHARED_MODULE_CREATE_CXX_FLAGS -shared)
  add_link_options(-Wl,-x)
endif()

abs_hil_add_rooms(${ABS_HIL_ROOMS_BEYOND_CORE})
if(CMAKE_SYSTEM_PROCESSOR STREQUAL wasm32)
  add_subdirectory(python/lab)
else()
  add_subdirectory(python)
  add_subdirectory(tests/core)
endif()
