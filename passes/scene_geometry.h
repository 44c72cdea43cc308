// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/error.h"
#include "passes/custom_kinds.h"
#include "passes/scene_closures.h"
#include "passes/shading_features.h"
#include "rhi/device.h"
#include "scene/scene.h"

/// @file
/// The geometry of a scene on a device: one buffer for each vertex attribute that something needs, one for indices and
/// one for the places of instances; and the list of what is to be drawn.
///
///     NACRE_TRY(auto geometry, SceneGeometry::create(device, scene, slabs, closures, kinds, all_textures, true));
///     for (const Draw& draw : geometry->draws()) geometry->record(list, draw, attributes);

namespace nacre::passes {

/// One primitive at one or more places.
struct Draw {
    std::uint32_t material = 0;
    ShadingFeatures features;
    ShadingFeatures closure_features;  ///< Where the material is shaded by closures.
    bool has_closures = false;
    bool emits = false;  ///< By whichever of both shades it.
    scene::Topology topology = scene::Topology::triangle_list;
    bool mirrored = false;      ///< Front faces wind clockwise.
    bool two_faces = false;     ///< Back faces are drawn too.
    materials::AlphaMode alpha_mode = materials::AlphaMode::opaque;
    std::uint64_t index_offset = 0;  ///< Bytes.
    std::uint32_t index_count = 0;
    std::array<std::uint64_t, attribute_count> attribute_offsets{};  ///< Bytes into the attribute's buffer.
    std::uint64_t instance_offset = 0;  ///< Bytes.
    std::uint32_t instance_count = 0;
    scene::Bounds bounds;  ///< World, of all its instances.
};

class SceneGeometry {
  public:
    /// Uploads what the draws of the scene need. `slabs` has one entry for each material.
    static Expected<std::unique_ptr<SceneGeometry>> create(rhi::Device& device, const scene::Scene& scene,
                                                           const std::vector<materials::SingleSlab>& slabs,
                                                           const SceneClosures& closures, const CustomKinds& kinds,
                                                           std::uint32_t allowed_textures, bool with_colors);
    ~SceneGeometry();
    SceneGeometry(const SceneGeometry&) = delete;
    SceneGeometry& operator=(const SceneGeometry&) = delete;

    [[nodiscard]] const std::vector<Draw>& draws() const { return draws_; }
    [[nodiscard]] const scene::Bounds& bounds() const { return bounds_; }
    [[nodiscard]] std::uint64_t bytes() const { return bytes_; }
    /// All buffers that draws read, for the statements of passes.
    struct NamedBuffer {
        rhi::Buffer buffer;
        rhi::BufferDesc desc;
        rhi::ResourceUse use;
        std::uint32_t attribute = ~0u;  ///< Number of the attribute; ~0: every draw reads it.
    };
    [[nodiscard]] const std::vector<NamedBuffer>& buffers() const { return all_buffers_; }

    /// Binds the given attributes (attribute_bit) and the instances in ascending order of slots, and draws.
    void record(rhi::CommandList& list, const Draw& draw, std::uint32_t attributes) const;

    /// For each draw whether any of it can be inside the view. Bounds are tested, so that some that are not may count.
    [[nodiscard]] std::vector<bool> visible_in(const glm::mat4& view_projection) const;

    /// The vertex layout that `record` expects, written into a pipeline description.
    static void describe_vertices(std::uint32_t attributes, rhi::GraphicsPipelineDesc& pipeline);

  private:
    explicit SceneGeometry(rhi::Device& device) : device_(device) {}

    rhi::Device& device_;
    std::array<rhi::Buffer, attribute_count> attributes_{};
    rhi::Buffer indices_{}, instances_{};
    std::vector<NamedBuffer> all_buffers_;
    std::vector<Draw> draws_;
    scene::Bounds bounds_;
    std::uint64_t bytes_ = 0;
};

}  // namespace nacre::passes
