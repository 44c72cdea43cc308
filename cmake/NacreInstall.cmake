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

# The interface: what users of a part include. The rest of its headers is how it works inside.
set(public_headers
  core/disk_cache.h core/dynamic_library.h core/embedded_file.h core/error.h core/file.h core/hash.h core/image.h
  core/log.h core/progress.h core/srgb.h core/text_position.h
  rhi/acceleration_structure.h rhi/backend.h rhi/capabilities.h rhi/command_list.h rhi/command_stream.h rhi/device.h
  rhi/format.h rhi/handle.h
  rhi/pipeline.h rhi/pipeline_reloader.h rhi/reflection.h rhi/resources.h rhi/shader_compiler.h rhi/texture_table.h
  rhi/trace.h rhi/validation.h
  materials/description.h materials/single_slab.h materials/slab.h materials/closures/library.h materials/closures/lobes.h
  materials/closures/classic.glsl materials/closures/closure.glsl materials/closures/diffuse.glsl
  materials/closures/features.glsl materials/closures/fresnel.glsl materials/closures/fuzz.glsl
  materials/closures/ggx.glsl materials/closures/glints.glsl materials/closures/haze.glsl materials/closures/math.glsl
  materials/closures/medium.glsl materials/closures/slab.glsl materials/closures/tables.glsl
  materials/closures/blending.glsl materials/closures/operators.glsl materials/closures/table_buffers.glsl
  materials/closures/octahedral.glsl materials/closures/stored_fields.glsl materials/closures/stored_frame.glsl
  materials/closures/table_textures.glsl materials/storage_shader.h
  materials/closures/conversions.glsl materials/closures/medium_inputs.glsl
  materials/closures/covered_closure.glsl materials/closures/prepared_closure.glsl
  materials/closures/specular_tables.glsl materials/specular_table.h
  materials/closures/thin_film.glsl materials/building_blocks.h materials/builtin_materials.h materials/conversions.h
  materials/custom_material.h materials/description_tree.h materials/evaluation.h materials/layering_error.h
  materials/material_blob.h materials/random_walk.h materials/reference_stacks.h
  materials/preview.h materials/simplification.h materials/storage.h materials/topology.h materials/tree.h
  materials/tree_json.h materials/tree_shader.h
  scene/builtin.h scene/environment.h scene/load.h scene/scene.h scene/shapes.h scene/tangents.h
  passes/frame_graph.h passes/gbuffer_layout.h passes/plan.h passes/profiles.h passes/renderer.h
  measure/closure_comparison.h measure/comparison_page.h measure/cross_backend.h measure/flip.h measure/frame_times.h measure/image_metrics.h
  measure/numerical_error.h measure/report_page.h measure/texel_decoding.h measure/texture_comparison.h measure/tolerance.h)
foreach(header IN LISTS public_headers)
  get_filename_component(folder "${header}" DIRECTORY)
  install(FILES "${CMAKE_SOURCE_DIR}/${header}" DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}/nacre/${folder}")
endforeach()
# Of a backend a program needs only the header that declares it.
foreach(backend vulkan gl cpu)
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
