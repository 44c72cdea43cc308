// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "core/error.h"

/// @file
/// The list of everything that the validation layer can say, each with a stable number, a name and a sentence.
/// A number is never used again for something else.

// X(number, enumerator, "name", "meaning")
#define NACRE_VALIDATION_RULES(X)                                                                                      \
    X(101, stale_handle, "stale-handle", "An object is used after it was destroyed.")                                  \
    X(102, empty_handle, "empty-handle", "A call needs an object and got an empty handle.")                            \
    X(103, foreign_handle, "foreign-handle", "An object is used with a device that did not make it.")                  \
    X(104, destroyed_twice, "destroyed-twice", "An object is destroyed a second time.")                                \
    X(105, destroyed_in_bind_group, "destroyed-in-bind-group",                                                         \
      "A bind group is used after one of its resources was destroyed.")                                                \
    X(106, list_already_submitted, "list-already-submitted",                                                           \
      "A command list is used after it was submitted or moved from.")                                                  \
    X(107, list_of_other_device, "list-of-other-device",                                                               \
      "A command list is submitted to a device that did not make it.")                                                 \
    X(108, fence_unknown, "fence-unknown", "A fence is waited for that this device did not give.")                     \
    X(201, buffer_size, "buffer-size", "A buffer has no bytes or more than the device allows.")                        \
    X(202, buffer_usage, "buffer-usage", "A buffer has no usage, or one that its kind of memory cannot serve.")        \
    X(210, texture_format, "texture-format", "A texture has no format, or one that textures cannot have.")             \
    X(211, texture_size, "texture-size", "A texture has no texels, or more along an axis than the device allows.")     \
    X(212, texture_shape, "texture-shape", "Height, depth or layers do not fit the dimension of a texture.")           \
    X(213, texture_layers, "texture-layers", "A texture has no layers or more than the device allows.")                \
    X(214, texture_mips, "texture-mips", "A texture has no mips or more than its size has.")                           \
    X(215, texture_samples, "texture-samples",                                                                         \
      "A texture has a number of samples that the device or its other properties do not allow.")                       \
    X(216, texture_usage, "texture-usage", "A texture has no usage.")                                                  \
    X(217, texture_format_usage, "texture-format-usage", "The device cannot use a format in the way that is asked.")   \
    X(218, texture_bytes, "texture-bytes", "A texture needs more memory than any device could have.")                  \
    X(230, sampler_anisotropy, "sampler-anisotropy", "The anisotropy of a sampler is out of range or missing here.")   \
    X(231, sampler_border, "sampler-border", "A sampler clamps to a border and the device cannot.")                    \
    X(232, sampler_lod, "sampler-lod", "The level-of-detail values of a sampler are not finite or not in order.")      \
    X(240, view_range, "view-range", "A view reaches beyond the mips or layers of its texture.")                       \
    X(241, view_dimension, "view-dimension", "A view has a dimension that its texture cannot be seen in.")             \
    X(242, view_format, "view-format", "A view has a format that its texture cannot be seen in.")                      \
    X(250, query_pool_count, "query-pool-count", "A query pool has a count outside of 1 to 65,536.")                   \
    X(251, query_type, "query-type", "The device has no queries of this type.")                                        \
    X(260, acceleration_structure_unsupported, "acceleration-structure-unsupported",                                   \
      "The device has no acceleration structures, or none of this geometry.")                                          \
    X(261, acceleration_structure_level, "acceleration-structure-level",                                               \
      "An acceleration structure has what the other level has, nothing at all, or too much.")                          \
    X(262, acceleration_structure_geometry, "acceleration-structure-geometry",                                         \
      "A geometry of an acceleration structure has counts, a format or a stride that do not fit.")                     \
    X(301, layout_duplicate, "layout-duplicate", "A bind-group layout holds a binding twice.")                         \
    X(302, layout_stages, "layout-stages", "A binding of a layout is seen by no shader stage.")                        \
    X(303, layout_limit, "layout-limit", "A layout or pipeline holds more bindings of a kind than a stage can have.")  \
    X(304, layout_unbounded, "layout-unbounded",                                                                       \
      "An unbounded array is asked for where the device or the binding's type has none.")                              \
    X(305, layout_binding_limit, "layout-binding-limit", "A binding has a number above 4,095.")                        \
    X(306, layout_texel_buffer, "layout-texel-buffer", "A layout holds a texel buffer and the device has none.")       \
    X(310, group_unknown_binding, "group-unknown-binding",                                                             \
      "A bind group has an entry for a binding that its layout lacks.")                                                \
    X(311, group_duplicate_entry, "group-duplicate-entry", "A bind group has two entries for the same place.")         \
    X(312, group_missing_entry, "group-missing-entry", "A bind group has no entry for a binding of its layout.")       \
    X(313, group_wrong_resource, "group-wrong-resource",                                                               \
      "An entry of a bind group holds another kind of resource than its binding.")                                     \
    X(314, group_buffer_usage, "group-buffer-usage", "A buffer in a bind group lacks the usage of its binding.")       \
    X(315, group_texture_usage, "group-texture-usage", "A texture in a bind group lacks the usage of its binding.")    \
    X(316, group_range, "group-range", "An entry of a bind group reaches beyond its buffer.")                          \
    X(317, group_alignment, "group-alignment", "The offset of an entry is not a multiple of the device's alignment.")  \
    X(318, group_range_limit, "group-range-limit", "An entry spans more bytes than the device can bind.")              \
    X(319, group_element, "group-element", "An entry has an index beyond the array of its binding.")                   \
    X(320, group_unfilterable, "group-unfilterable",                                                                   \
      "A linear filter is combined with a format that cannot be filtered.")                                            \
    X(321, group_storage_view, "group-storage-view", "A storage image views more than one mip, or several samples.")   \
    X(322, group_acceleration_structure_level, "group-acceleration-structure-level",                                   \
      "A bottom-level acceleration structure is bound to a shader.")                                                   \
    X(323, group_texel_format, "group-texel-format",                                                                   \
      "A texel buffer has no format, or one that the device cannot use in buffers in this way.")                       \
    X(324, group_texel_range, "group-texel-range",                                                                     \
      "The range of a texel buffer holds no element, or ends inside of one.")                                          \
    X(401, shader_stage, "shader-stage", "A shader has no stage or several.")                                          \
    X(402, shader_capability, "shader-capability", "A shader needs a feature that the device lacks.")                  \
    X(403, shader_storage_stage, "shader-storage-stage",                                                               \
      "A vertex or fragment shader uses storage buffers or images and the device has none there.")                     \
    X(405, pipeline_stage, "pipeline-stage", "A pipeline has a shader of the wrong stage.")                            \
    X(406, pipeline_interface, "pipeline-interface",                                                                   \
      "A fragment shader reads an input that the vertex shader does not write in that type.")                          \
    X(407, pipeline_binding_conflict, "pipeline-binding-conflict", "Two stages declare a binding in different ways.")  \
    X(408, pipeline_layout, "pipeline-layout",                                                                         \
      "An explicit layout does not hold what the shaders of the pipeline use.")                                        \
    X(409, pipeline_group_limit, "pipeline-group-limit", "A shader uses a bind-group index that the device lacks.")    \
    X(410, vertex_attribute_missing, "vertex-attribute-missing",                                                       \
      "A vertex shader reads an attribute that is not described.")                                                     \
    X(411, vertex_attribute_kind, "vertex-attribute-kind",                                                             \
      "An attribute's format does not give what the shader reads.")                                                    \
    X(412, vertex_attribute_format, "vertex-attribute-format", "The device has no vertex attributes of this format.")  \
    X(413, vertex_attribute_layout, "vertex-attribute-layout",                                                         \
      "Attributes share a location, exceed the stride or name a missing buffer.")                                      \
    X(414, vertex_limit, "vertex-limit", "More attributes, vertex buffers or a larger stride than the device has.")    \
    X(415, color_target_limit, "color-target-limit", "A pipeline or pass has more color targets than the device.")     \
    X(416, color_target_format, "color-target-format", "The device cannot render to this format.")                     \
    X(417, color_target_kind, "color-target-kind", "A shader output is of another kind than its color target.")        \
    X(418, color_target_unwritten, "color-target-unwritten", "A color target is not written by the fragment shader.")  \
    X(419, blend_format, "blend-format", "Blending is on for a format that cannot be blended.")                        \
    X(420, dual_source, "dual-source",                                                                                 \
      "Dual-source blending is used where the device, the targets or the shader have none.")                           \
    X(421, independent_blend, "independent-blend", "Color targets differ in blending and the device cannot do that.")  \
    X(422, depth_format, "depth-format", "A depth format is not one, or the device cannot render to it.")              \
    X(423, depth_state, "depth-state", "A depth or stencil test is on and the format has no depth or stencil.")        \
    X(424, pipeline_samples, "pipeline-samples",                                                                       \
      "A pipeline has a number of samples that the device cannot draw with.")                                          \
    X(425, pipeline_feature, "pipeline-feature",                                                                       \
      "A pipeline uses depth clamp, a bias clamp or lines that the device lacks.")                                     \
    X(426, push_constant_limit, "push-constant-limit", "A shader declares more push constants than the device has.")   \
    X(427, specialization_id, "specialization-id",                                                                     \
      "A specialization constant is given that no shader declares, or given twice.")                                   \
    X(428, workgroup_limit, "workgroup-limit", "A workgroup is larger than the device allows.")                        \
    X(429, fragment_missing, "fragment-missing", "A pipeline has color targets and no fragment shader.")               \
    X(501, outside_render_pass, "outside-render-pass", "A command that belongs into a render pass stands outside.")    \
    X(502, inside_render_pass, "inside-render-pass", "A command that belongs outside of render passes stands in one.") \
    X(503, render_pass_empty, "render-pass-empty", "A render pass has no target.")                                     \
    X(504, attachment_view, "attachment-view", "A target of a render pass is not one mip of one layer.")               \
    X(505, attachment_usage, "attachment-usage", "A target of a render pass lacks the usage for it.")                  \
    X(506, attachment_format, "attachment-format", "A target of a render pass is of a format that cannot be one.")     \
    X(507, attachment_size, "attachment-size", "The targets of a render pass differ in size.")                         \
    X(508, attachment_samples, "attachment-samples", "The targets of a render pass differ in samples.")                \
    X(509, attachment_twice, "attachment-twice", "One part of a texture is a target twice in a render pass.")          \
    X(510, resolve_target, "resolve-target", "A resolve target does not fit the target that it is resolved from.")     \
    X(511, render_pass_open, "render-pass-open", "A command list is submitted inside a render pass.")                  \
    X(512, read_only_cleared, "read-only-cleared", "A read-only depth target is cleared or discarded.")                \
    X(520, no_pipeline, "no-pipeline", "A draw or dispatch comes before a pipeline is set.")                           \
    X(521, pipeline_target_mismatch, "pipeline-target-mismatch",                                                       \
      "A pipeline was made for other targets than the pass has.")                                                      \
    X(522, read_only_depth_written, "read-only-depth-written",                                                         \
      "A pipeline writes depth or stencil in a pass where they are read-only.")                                        \
    X(523, bind_group_missing, "bind-group-missing", "A draw or dispatch lacks a bind group that its pipeline uses.")  \
    X(524, bind_group_layout_mismatch, "bind-group-layout-mismatch",                                                   \
      "A bind group has another layout than the pipeline expects.")                                                    \
    X(525, bind_group_index, "bind-group-index", "A bind group is set at an index that the device lacks.")             \
    X(526, push_constants_unset, "push-constants-unset",                                                               \
      "A draw or dispatch lacks push constants that its pipeline reads.")                                              \
    X(527, push_constants_range, "push-constants-range",                                                               \
      "Push constants are not aligned, empty, or beyond the device's limit.")                                          \
    X(528, vertex_buffer_missing, "vertex-buffer-missing", "A draw lacks a vertex buffer that its pipeline reads.")    \
    X(529, vertex_buffer_use, "vertex-buffer-use", "A vertex buffer lacks the usage, or its slot or offset is wrong.") \
    X(530, vertex_range, "vertex-range", "A draw reads vertices or instances beyond a vertex buffer.")                 \
    X(531, index_buffer_missing, "index-buffer-missing", "An indexed draw comes before an index buffer is set.")       \
    X(532, index_buffer_use, "index-buffer-use", "An index buffer lacks the usage, or its offset is wrong.")           \
    X(533, index_range, "index-range", "A draw reads indices beyond the index buffer.")                                \
    X(534, first_instance, "first-instance", "A draw has a first instance and the device has none.")                   \
    X(535, indirect_use, "indirect-use",                                                                               \
      "A buffer of indirect arguments lacks the usage, or offset or stride are wrong.")                                \
    X(536, indirect_range, "indirect-range", "Indirect arguments lie beyond their buffer.")                            \
    X(540, viewport, "viewport", "A viewport is not finite, has no size, or has depths outside of 0 to 1.")            \
    X(541, scissor, "scissor", "A scissor rectangle reaches beyond the targets of the pass.")                          \
    X(545, dispatch_limit, "dispatch-limit", "A dispatch has more workgroups than the device allows.")                 \
    X(546, binding_view, "binding-view",                                                                               \
      "A texture or texel buffer in a bind group does not have the dimension, format or kind that the shader reads.")  \
    X(547, binding_size, "binding-size",                                                                               \
      "A buffer in a bind group is smaller than the block that the shader declares.")                                  \
    X(550, copy_range, "copy-range", "A copy, fill or clear reaches beyond a resource.")                               \
    X(551, copy_usage, "copy-usage", "A resource of a copy, fill or clear lacks the usage for it.")                    \
    X(552, copy_alignment, "copy-alignment", "An offset, size or row of a copy or fill is not aligned.")               \
    X(553, copy_format, "copy-format", "Two textures of a copy, or a texture and its clear, do not fit in format.")    \
    X(554, copy_overlap, "copy-overlap", "Source and destination of a copy overlap.")                                  \
    X(555, copy_samples, "copy-samples", "A copy to or from a texture of several samples is not possible.")            \
    X(558, generate_mips, "generate-mips", "Mips cannot be generated for a texture of this format, usage or samples.") \
    X(560, query_type_mismatch, "query-type-mismatch", "A query pool is of another type than the command.")            \
    X(561, query_range, "query-range", "A query lies beyond its pool.")                                                \
    X(562, query_unbalanced, "query-unbalanced", "An occlusion query is begun twice, or ended without a begin.")       \
    X(563, query_unwritten, "query-unwritten", "Results of a query are read that was never written.")                  \
    X(565, debug_group_unbalanced, "debug-group-unbalanced", "Debug groups are not pushed and popped in pairs.")       \
    X(566, statement_unbalanced, "statement-unbalanced",                                                               \
      "Statements are not begun and ended in pairs, outside of passes.")                                               \
    X(570, texture_hazard, "texture-hazard",                                                                           \
      "A part of a texture is used in two ways in one pass or dispatch that exclude each other.")                      \
    X(571, buffer_hazard, "buffer-hazard",                                                                             \
      "A buffer is written and read in one pass or dispatch in ways that exclude each other.")                         \
    X(580, build_sources, "build-sources", "A build has sources of another kind or number than its structure.")        \
    X(581, build_usage, "build-usage", "A buffer of a build lacks the usage for it.")                                  \
    X(582, build_alignment, "build-alignment", "An offset into a buffer of a build is not aligned.")                   \
    X(583, build_range, "build-range", "A build reads beyond a buffer.")                                               \
    X(584, build_instance, "build-instance", "An instance has no bottom level, or values out of range.")               \
    X(585, structure_update, "structure-update",                                                                       \
      "An acceleration structure is updated that was not made for it, or that was never built.")                       \
    X(586, structure_unbuilt, "structure-unbuilt", "An acceleration structure is read that was never built.")          \
    X(587, structure_bottom_destroyed, "structure-bottom-destroyed",                                                   \
      "A top-level acceleration structure is read after one of its bottom levels was destroyed.")                      \
    X(588, structure_outdated, "structure-outdated",                                                                   \
      "A top-level acceleration structure is read after one of its bottom levels was built or updated.")               \
    X(601, map_memory, "map-memory", "A buffer is mapped whose memory the host cannot reach.")                         \
    X(602, map_state, "map-state", "A buffer is mapped twice, or unmapped without being mapped.")                      \
    X(603, mapped_in_submission, "mapped-in-submission", "A buffer is used by submitted work while it is mapped.")     \
    X(604, content_range, "content-range", "A write or read of content reaches beyond the resource.")                  \
    X(605, content_usage, "content-usage", "A texture lacks the usage for writing or reading its content.")            \
    X(606, content_size, "content-size", "The data given for a part of a texture has another size than the part.")     \
    X(701, statement_missing, "statement-missing",                                                                     \
      "A pass uses a resource in a way that its statement does not name.")                                             \
    X(702, statement_superfluous, "statement-superfluous",                                                             \
      "A statement names a use of a resource that the pass does not make.")

namespace nacre::rhi {

enum class Rule : std::uint16_t {
#define NACRE_RULE_ENUMERATOR(number, enumerator, name, meaning) enumerator = number,
    NACRE_VALIDATION_RULES(NACRE_RULE_ENUMERATOR)
#undef NACRE_RULE_ENUMERATOR
};

/// "N-524 bind-group-layout-mismatch"
std::string_view code_of(Rule rule);

/// A broken rule, before it becomes a message and an error.
struct Problem {
    Rule rule;
    ErrorCode code = ErrorCode::validation;
    std::string attempted;  ///< "draw"
    std::string subject;    ///< "list 'frame', pass 'lighting', pipeline 'tone'"
    std::string reason;     ///< Expectation and finding.
    std::string remedy;
};

}  // namespace nacre::rhi
