// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "backends/gl/driver.h"
#include "backends/gl/shader.h"
#include "core/disk_cache.h"

/// @file
/// A linked program with the tables that tell what to bind for it, and its copy on disk.

namespace nacre::gl {

class Program {
  public:
    /// A range of binding points and where their content lies in the bind groups.
    struct Slot {
        SlotRange range;
        std::int32_t entry = -1;  ///< Position in the group's entries.
    };
    struct TextureSlot {
        TextureRange range;
        std::int32_t entry = -1, sampler_entry = -1;
    };
    struct PushConstant {
        PushConstantLeaf leaf;
        GLint location = -1;
    };

    ~Program();

    GLuint name = 0;
    std::vector<Slot> slots;
    std::vector<TextureSlot> textures;
    std::vector<PushConstant> push_constants;
    GLint base_instance_location = -1;
    bool flat_inputs = false;
    /// Push constants that the uniforms hold.
    std::vector<std::byte> uploaded;

    /// Sets the uniforms that differ from `content`; the program is in use. Worker thread only.
    void upload_push_constants(const Functions& gl, std::span<const std::byte> content);

    DriverPointer driver;
};

/// Translates, compiles and links, or takes the result from `cache`. An entry that the driver refuses (damaged, of
/// another driver) is made anew. Errors: unsupported, shader_compile with the driver's log.
Expected<std::unique_ptr<Program>> make_program(const DriverPointer& driver, const DiskCache& cache,
                                                std::span<rhi::BackendShader* const> stages,
                                                std::span<const rhi::SpecializationConstant> specialization,
                                                std::span<rhi::BackendBindGroupLayout* const> layouts,
                                                const std::string& name);

}  // namespace nacre::gl
