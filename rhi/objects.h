// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "rhi/backend.h"
#include "rhi/slot_table.h"

/// @file
/// What the front end keeps for each object: the description, the backend's object, and where the object stands.

namespace nacre::rhi {

/// Most bind groups that a pipeline can have, over all devices.
inline constexpr std::uint32_t most_bind_groups = 8;
/// Most vertex buffers and color targets, over all devices.
inline constexpr std::uint32_t most_vertex_buffers = 32;
inline constexpr std::uint32_t most_color_targets = 8;

/// A part of a texture, complete.
struct SubresourceRange {
    std::uint32_t base_mip = 0, mip_count = 1, base_layer = 0, layer_count = 1;
};

struct BufferObject {
    std::unique_ptr<BackendBuffer> backend;
    BufferDesc desc;
    Buffer handle;
    bool is_mapped = false;
    std::uint64_t last_serial = 0;  ///< Of the last submission that used it.

    // Kept by StateTracker.
    ResourceState state{};
    ResourceState scope_state{};
    std::uint64_t scope_epoch = 0;
    ResourceState saved_state{};
    std::uint64_t saved_epoch = 0;
};

struct TextureObject {
    std::unique_ptr<BackendTexture> backend;
    TextureDesc desc;
    Texture handle;
    std::uint64_t last_serial = 0;

    // Kept by StateTracker: one state while all parts agree, else one for each mip of each layer.
    ResourceState state{};
    std::vector<ResourceState> states{};
    ResourceState scope_state{};
    std::vector<ResourceState> scope_states{};
    std::vector<bool> scope_discards{};
    bool scope_discard = false;
    std::uint64_t scope_epoch = 0;
    ResourceState saved_state{};
    std::vector<ResourceState> saved_states{};
    std::uint64_t saved_epoch = 0;
};

struct AccelerationStructureObject {
    std::unique_ptr<BackendAccelerationStructure> backend;
    AccelerationStructureDesc desc;
    AccelerationStructure handle;

    /// Of one bottom level that a top level was built over.
    struct BottomLevel {
        SlotTable<AccelerationStructure, AccelerationStructureObject>::Slot* slot = nullptr;
        std::uint32_t generation = 0;
        std::uint64_t builds = 0;  ///< That it had then.
    };
    /// Content as of the last submission.
    struct Content {
        std::uint64_t builds = 0;  ///< Number of builds and updates; 0: none.
        std::uint32_t count = 0;   ///< Geometries or instances.
        std::vector<BottomLevel> bottom_levels{};
    };
    Content content{}, saved_content{};

    // Kept by StateTracker.
    ResourceState state{};
    ResourceState scope_state{};
    std::uint64_t scope_epoch = 0;
    ResourceState saved_state{};
    std::uint64_t saved_epoch = 0;
};

struct SamplerObject {
    std::unique_ptr<BackendSampler> backend;
    SamplerDesc desc;
};

struct ShaderObject {
    /// Shared with the pipelines that are made from it, which may outlive it.
    std::shared_ptr<BackendShader> backend;
    ShaderStage stage = ShaderStage::none;
};

struct BindGroupLayoutObject {
    std::unique_ptr<BackendBindGroupLayout> backend;
    BindGroupLayoutDesc desc;  ///< Bindings sorted by number.
    bool has_unbounded = false;
};

/// One resource of a bind group, and what shaders do with it.
struct BufferUse {
    SlotTable<Buffer, BufferObject>::Slot* slot = nullptr;
    std::uint32_t generation = 0;
    std::uint32_t binding = 0;
    ResourceState state{};
    std::uint64_t offset = 0, size = 0;
    Format format = Format::undefined;  ///< Of the elements of a texel buffer.
};
struct TextureUse {
    SlotTable<Texture, TextureObject>::Slot* slot = nullptr;
    std::uint32_t generation = 0;
    std::uint32_t binding = 0;
    ResourceState state{};
    SubresourceRange range{};
    ViewDimension dimension = ViewDimension::d2;
    Format format = Format::undefined;
};
struct SamplerUse {
    SlotTable<Sampler, SamplerObject>::Slot* slot = nullptr;
    std::uint32_t generation = 0;
    std::uint32_t binding = 0;
};

struct AccelerationStructureUse {
    SlotTable<AccelerationStructure, AccelerationStructureObject>::Slot* slot = nullptr;
    std::uint32_t generation = 0;
    std::uint32_t binding = 0;
    ResourceState state{};
};

struct BindGroupObject {
    std::unique_ptr<BackendBindGroup> backend;
    BindGroupLayout layout;
    std::string name;
    std::vector<BufferUse> buffers;
    std::vector<TextureUse> textures;
    std::vector<SamplerUse> samplers;
    std::vector<AccelerationStructureUse> acceleration_structures;
    std::uint64_t merged_epoch = 0;   ///< Scope into which its uses were merged last.
    std::uint64_t checked_epoch = 0;  ///< Count of destructions at which its resources were known to live.
};

/// What graphics and compute pipelines have in common.
struct PipelineCommon {
    std::string name;
    std::vector<BindGroupLayout> layouts;  ///< One for each index up to the highest used.
    std::uint32_t group_mask = 0;          ///< Indices whose layout has bindings.
    std::uint32_t push_constant_bytes = 0;
    std::vector<ReflectedBinding> bindings;  ///< What the shaders declare, merged over the stages.
    /// Kept alive for backends that look at them when the pipeline is first used.
    std::vector<std::shared_ptr<BackendShader>> shaders;
};

struct GraphicsPipelineObject {
    std::unique_ptr<BackendGraphicsPipeline> backend;
    PipelineCommon common;
    GraphicsPipelineDesc desc;
    std::uint32_t vertex_buffer_mask = 0;  ///< Slots that attributes read.
    bool writes_depth = false;             ///< Depth or stencil.
};

struct ComputePipelineObject {
    std::unique_ptr<BackendComputePipeline> backend;
    PipelineCommon common;
};

struct QueryPoolObject {
    std::unique_ptr<BackendQueryPool> backend;
    QueryPoolDesc desc;
    std::vector<bool> written;
    std::uint64_t last_serial = 0;
};

/// The view with every default filled in, as it applies to a texture; does not check it.
ViewReference complete_view(const TextureView& view, const TextureDesc& desc);
/// The copy region with "tight" and "whole" replaced by figures; does not check it.
BufferTextureCopy complete_region(const BufferTextureCopy& region, const TextureDesc& desc);
TextureCopy complete_region(const TextureCopy& region, const TextureDesc& source);
/// Bytes of a buffer that a complete region touches behind its offset. No overflow for checked extents.
std::uint64_t region_bytes(const BufferTextureCopy& region, const TextureDesc& desc);

/// Number of array layers that copies, views and states see: `layers`, whatever the dimension.
inline std::uint32_t layers_of(const TextureDesc& desc) { return desc.layers; }
inline bool is_whole(const SubresourceRange& range, const TextureDesc& desc) {
    return range.mip_count == desc.mips && range.layer_count == layers_of(desc);
}

}  // namespace nacre::rhi
