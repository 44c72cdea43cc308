# SPDX-License-Identifier: Apache-2.0
# Script mode; see CMakeLists.txt beside it.
function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT result EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "'${command}' ended with ${result}:\n${output}")
  endif()
  set(output "${output}" PARENT_SCOPE)
endfunction()

file(REMOVE_RECURSE "${WORK}")
run("${CMAKE_COMMAND}" --install "${BUILD}" --prefix "${WORK}/prefix")

# Headers of Nacre must come from the prefix: the consumer is copied away from the source tree.
file(COPY "${CONSUMER}/" DESTINATION "${WORK}/consumer")
# Every installed header finds what it includes among the installed ones.
file(GLOB_RECURSE headers RELATIVE "${WORK}/prefix/include/nacre" "${WORK}/prefix/include/nacre/*.h")
list(TRANSFORM headers REPLACE "(.+)" "#include \"\\1\"\n")
list(JOIN headers "" includes)
file(WRITE "${WORK}/consumer/all_headers.cpp" "${includes}")
run("${CMAKE_COMMAND}" -S "${WORK}/consumer" -B "${WORK}/consumer-build" -G Ninja -DCMAKE_BUILD_TYPE=Release
  "-DCMAKE_CXX_COMPILER=${COMPILER}" "-DCMAKE_CXX_FLAGS=${FLAGS}" "-DCMAKE_PREFIX_PATH=${WORK}/prefix")
run("${CMAKE_COMMAND}" --build "${WORK}/consumer-build")
run("${WORK}/consumer-build/consumer")
message(STATUS "the program outside the tree says:\n${output}")
if(NOT output MATCHES "nacre works")
  message(FATAL_ERROR "the program outside the tree did not say 'nacre works'")
endif()

# The installed command stands on its own.
if(EXISTS "${BUILD}/bin/nacre")
  run("${WORK}/prefix/bin/nacre" --version)
  if(NOT output MATCHES "${VERSION}")
    message(FATAL_ERROR "the installed command tells another version than ${VERSION}: ${output}")
  endif()
endif()
