# SPDX-License-Identifier: Apache-2.0
# What `cmake --install` puts where: the command into bin, the static libraries into lib, the headers into include/nacre,
# and a CMake package so that find_package(nacre) works. Included last, when all targets exist.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

# A target `Name::target` that a part was linked with comes from the package of that name, `Name` or `Name-static` too.
get_property(NACRE_PACKAGES GLOBAL PROPERTY NACRE_PACKAGES)
list(REMOVE_DUPLICATES NACRE_PACKAGES)
list(SORT NACRE_PACKAGES)

set(package_dir "${CMAKE_INSTALL_LIBDIR}/cmake/nacre")
configure_package_config_file(cmake/nacreConfig.cmake.in "${CMAKE_BINARY_DIR}/nacreConfig.cmake"
  INSTALL_DESTINATION "${package_dir}")
write_basic_package_version_file("${CMAKE_BINARY_DIR}/nacreConfigVersion.cmake" COMPATIBILITY SameMinorVersion)
install(FILES "${CMAKE_BINARY_DIR}/nacreConfig.cmake" "${CMAKE_BINARY_DIR}/nacreConfigVersion.cmake"
  DESTINATION "${package_dir}")
install(EXPORT nacre-targets NAMESPACE nacre:: DESTINATION "${package_dir}")

foreach(part core rhi materials scene passes measure)
  install(DIRECTORY "${CMAKE_SOURCE_DIR}/${part}" DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}/nacre"
    FILES_MATCHING PATTERN "*.h")
endforeach()
# Of a backend a program needs only the header that declares it.
foreach(backend vulkan gl)
  if(EXISTS "${CMAKE_SOURCE_DIR}/backends/${backend}/${backend}_backend.h")
    install(FILES "${CMAKE_SOURCE_DIR}/backends/${backend}/${backend}_backend.h"
      DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}/nacre/backends/${backend}")
  endif()
endforeach()

if(TARGET nacre)
  install(TARGETS nacre)
endif()
if(EXISTS "${CMAKE_SOURCE_DIR}/samples/completion/nacre.bash")
  install(FILES "${CMAKE_SOURCE_DIR}/samples/completion/nacre.bash"
    DESTINATION "${CMAKE_INSTALL_DATADIR}/bash-completion/completions" RENAME nacre)
endif()
install(FILES LICENSE README.md CHANGELOG.md DESTINATION "${CMAKE_INSTALL_DOCDIR}")
