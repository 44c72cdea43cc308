# SPDX-License-Identifier: Apache-2.0
# What `cmake --install` puts where: the command into bin, the static libraries into lib, the headers into include/nacre,
# and a CMake package so that find_package(nacre) works. Included last, when all targets exist.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

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

# Headers that are no part of the interface: what a folder below a part holds, and these.
set(internal_headers
  core/image_formats.h rhi/device_access.h rhi/device_state.h rhi/embedded_shaders.h rhi/glslang_version.h
  rhi/object_checks.h rhi/objects.h rhi/pipeline_checks.h rhi/shader_compiler_glslang.h rhi/slot_table.h rhi/spirv.h
  rhi/state_tracker.h rhi/texture_pages.h rhi/validation_rules.h)
foreach(part core rhi materials scene passes measure)
  file(GLOB headers RELATIVE "${CMAKE_SOURCE_DIR}" CONFIGURE_DEPENDS "${part}/*.h")
  list(REMOVE_ITEM headers ${internal_headers})
  install(FILES ${headers} DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}/nacre/${part}")
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
