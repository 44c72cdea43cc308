# SPDX-License-Identifier: Apache-2.0
# The few functions with which every part, program and test of Nacre is declared.

set(CMAKE_CXX_STANDARD 23)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY "${CMAKE_BINARY_DIR}/bin")
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
# -O2: -O3 costs a fifth more compile time and gains nothing that the benchmarks show.
set(CMAKE_CXX_FLAGS_RELEASE "-O2 -g1")

# Half of what the compiler does for most files it does for their headers: several files at once take about two thirds of
# the time of a whole build, one changed file takes more.
option(NACRE_UNITY_BUILD "Compile up to eight files of a target at once" OFF)
set(CMAKE_UNITY_BUILD ${NACRE_UNITY_BUILD})

find_program(NACRE_CCACHE ccache)
if(NACRE_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  # Without the first it would not keep what is compiled with a precompiled header; with the others another checkout of the
  # same sources finds it.
  set(CMAKE_CXX_COMPILER_LAUNCHER env CCACHE_SLOPPINESS=pch_defines,time_macros "CCACHE_BASEDIR=${CMAKE_SOURCE_DIR}"
    CCACHE_NOHASHDIR=1 "${NACRE_CCACHE}")
endif()

add_compile_options(-Wall -Wextra -Wpedantic -Wshadow -Wno-missing-field-initializers -Winvalid-pch)
if(NACRE_UNITY_BUILD)
  # True of files that are compiled by themselves; together they see each other's names.
  add_compile_options(-Wno-shadow -Wno-subobject-linkage)
endif()
if(NACRE_SANITIZER STREQUAL "address")
  add_compile_options(-fsanitize=address,undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer -O1)
  add_link_options(-fsanitize=address,undefined)
elseif(NACRE_SANITIZER STREQUAL "thread")
  add_compile_options(-fsanitize=thread -fno-omit-frame-pointer -O1)
  add_link_options(-fsanitize=thread)
elseif(NOT NACRE_SANITIZER STREQUAL "")
  message(FATAL_ERROR "NACRE_SANITIZER is '${NACRE_SANITIZER}'; it can be empty, 'address' or 'thread'")
endif()

# Links in a quarter of the time; some seventy programs link all of Nacre.
include(CheckLinkerFlag)
check_linker_flag(CXX -fuse-ld=gold NACRE_HAS_GOLD)
if(NACRE_HAS_GOLD AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  add_link_options(-fuse-ld=gold)
endif()

# Tests run once for each compile: optimizing them costs a third more build time than it saves in running.
set(NACRE_TEST_OPTIONS -O0)
if(NACRE_SANITIZER STREQUAL "address")
  # The checks of pointers, most of which AddressSanitizer makes too, are two fifths of what a test takes to compile. The
  # parts that are tested keep them.
  list(APPEND NACRE_TEST_OPTIONS
    -fno-sanitize=null,alignment,vptr,object-size,nonnull-attribute,returns-nonnull-attribute)
endif()

if(NACRE_BUILD_FUZZERS)
  if(NOT CMAKE_CXX_COMPILER_ID MATCHES "Clang")
    message(FATAL_ERROR "NACRE_BUILD_FUZZERS needs clang: use the preset 'fuzz'")
  endif()
  add_compile_options(-fsanitize=fuzzer-no-link)
endif()

# nacre_embed_files(<target> NAMESPACE <c++ namespace> FILES <path>...)
# Puts text files (GLSL, JSON) into the program: generates embedded_files.h/.cpp in the given
# namespace with `std::span<const nacre::EmbeddedFile> embedded_files()`; paths are those below the
# source root ("passes/lighting/lighting.comp").
function(nacre_embed_files target)
  cmake_parse_arguments(ARG "" "NAMESPACE" "FILES" ${ARGN})
  string(REPLACE "::" "_" file_stem "${ARG_NAMESPACE}")
  set(output "${CMAKE_CURRENT_BINARY_DIR}/${file_stem}_embedded_files.cpp")
  set(inputs "")
  foreach(file IN LISTS ARG_FILES)
    list(APPEND inputs "${CMAKE_CURRENT_SOURCE_DIR}/${file}")
  endforeach()
  add_custom_command(
    OUTPUT "${output}"
    COMMAND "${CMAKE_COMMAND}" "-DOUTPUT=${output}" "-DNAMESPACE=${ARG_NAMESPACE}" "-DROOT=${CMAKE_SOURCE_DIR}"
            "-DINPUTS=${inputs}" -P "${CMAKE_SOURCE_DIR}/cmake/EmbedFiles.cmake"
    DEPENDS ${inputs} "${CMAKE_SOURCE_DIR}/cmake/EmbedFiles.cmake"
    COMMENT "Embedding files of ${ARG_NAMESPACE}"
    VERBATIM)
  target_sources(${target} PRIVATE "${output}")
endfunction()

# The precompiled header of all parts that use fmt; made by the first of them.
function(nacre_use_part_headers target)
  if(NOT TARGET nacre_part_headers)
    find_package(fmt REQUIRED)
    add_library(nacre_part_headers STATIC EXCLUDE_FROM_ALL "${CMAKE_SOURCE_DIR}/cmake/part_headers.cpp")
    target_compile_features(nacre_part_headers PRIVATE cxx_std_23)
    target_link_libraries(nacre_part_headers PRIVATE fmt::fmt)
    target_precompile_headers(nacre_part_headers PRIVATE "${CMAKE_SOURCE_DIR}/cmake/part_headers.h")
  endif()
  target_precompile_headers(${target} REUSE_FROM nacre_part_headers)
endfunction()

# nacre_add_part(<name> SOURCES ... [USES <part>...] [LIBRARIES <private library>...])
# One static library `nacre_<name>` (alias nacre::<name>); headers are included from the source root.
function(nacre_add_part name)
  cmake_parse_arguments(ARG "" "" "SOURCES;USES;LIBRARIES" ${ARGN})
  set(target "nacre_${name}")
  add_library(${target} STATIC ${ARG_SOURCES})
  add_library(nacre::${name} ALIAS ${target})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name})
  target_include_directories(${target} PUBLIC
    "$<BUILD_INTERFACE:${CMAKE_SOURCE_DIR}>" "$<INSTALL_INTERFACE:include/nacre>")
  target_compile_features(${target} PUBLIC cxx_std_23)
  foreach(part IN LISTS ARG_USES)
    target_link_libraries(${target} PUBLIC nacre::${part})
  endforeach()
  target_link_libraries(${target} PRIVATE ${ARG_LIBRARIES})
  if("fmt::fmt" IN_LIST ARG_LIBRARIES)
    nacre_use_part_headers(${target})
  endif()
  install(TARGETS ${target} EXPORT nacre-targets)
  # For nacreConfig.cmake: who links the installed library needs the packages behind it. The package of a library is
  # the one of those found that is named like it.
  foreach(library IN LISTS ARG_LIBRARIES)
    string(REGEX REPLACE "::.*$" "" name "${library}")
    string(REGEX REPLACE "-(static|shared)$" "" short_name "${name}")
    string(REPLACE "-" "_" underlined_name "${name}")
    foreach(package "${name}" "${short_name}" "${underlined_name}")
      if(${package}_FOUND)
        set_property(GLOBAL APPEND PROPERTY NACRE_PACKAGES "${package}")
        break()
      endif()
    endforeach()
  endforeach()
endfunction()

# nacre_add_test(<name> SOURCES ... USES <part>... [LIBRARIES ...] [LABELS ...] [TIMEOUT seconds])
# One GoogleTest program (with GoogleTest's own main() unless a source has one), registered with CTest under its name. The
# target tests_<label> builds the tests of a label.
function(nacre_add_test name)
  cmake_parse_arguments(ARG "" "TIMEOUT" "SOURCES;USES;LIBRARIES;LABELS" ${ARGN})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 300)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  foreach(part IN LISTS ARG_USES)
    target_link_libraries(${name} PRIVATE nacre::${part})
  endforeach()
  target_link_libraries(${name} PRIVATE ${ARG_LIBRARIES} GTest::gmock GTest::gtest GTest::gtest_main)
  target_include_directories(${name} PRIVATE "${CMAKE_SOURCE_DIR}")
  target_compile_options(${name} PRIVATE ${NACRE_TEST_OPTIONS})
  target_precompile_headers(${name} REUSE_FROM nacre_test_headers)
  add_test(NAME ${name} COMMAND ${name})
  # What takes long begins first, or it goes on alone at the end.
  set_tests_properties(${name} PROPERTIES TIMEOUT ${ARG_TIMEOUT} COST ${ARG_TIMEOUT} LABELS "${ARG_LABELS}")
  foreach(label IN LISTS ARG_LABELS)
    if(NOT TARGET tests_${label})
      add_custom_target(tests_${label})
    endif()
    add_dependencies(tests_${label} ${name})
  endforeach()
endfunction()

# nacre_add_fuzzer(<name ending in _fuzzer> SOURCES ... USES <part>... [LIBRARIES ...])
# One libFuzzer program, run by `./run fuzz`; its seeds are the files in tests/seeds/<name>, its dictionary is <name>.dict
# beside its source. Nothing without NACRE_BUILD_FUZZERS.
function(nacre_add_fuzzer name)
  cmake_parse_arguments(ARG "" "" "SOURCES;USES;LIBRARIES" ${ARGN})
  if(NOT NACRE_BUILD_FUZZERS)
    return()
  endif()
  add_executable(${name} ${ARG_SOURCES})
  foreach(part IN LISTS ARG_USES)
    target_link_libraries(${name} PRIVATE nacre::${part})
  endforeach()
  target_link_libraries(${name} PRIVATE ${ARG_LIBRARIES})
  target_link_options(${name} PRIVATE -fsanitize=fuzzer)
  if(NOT TARGET fuzzers)
    add_custom_target(fuzzers)
  endif()
  add_dependencies(fuzzers ${name})
endfunction()
