// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "backends/gl/program.h"

/// @file
/// Pipelines: a program, a vertex array that holds the attribute formats, and the fixed-function state.

namespace nacre::gl {

class GlGraphicsPipeline : public rhi::BackendGraphicsPipeline {
  public:
    explicit GlGraphicsPipeline(DriverPointer driver) : driver_(std::move(driver)) {}
    ~GlGraphicsPipeline() override;

    static Expected<std::unique_ptr<rhi::BackendGraphicsPipeline>> create(
        const DriverPointer& driver, const DiskCache& cache, const rhi::BackendGraphicsPipelineDesc& desc);

    /// Sets everything but what draws set themselves (stencil reference, blend constants). Worker thread only.
    void apply(Driver& driver, std::uint32_t stencil_reference) const;
    /// Compare functions and masks hold the reference in OpenGL.
    void apply_stencil_reference(const Driver& driver, std::uint32_t reference) const;

    std::unique_ptr<Program> program;
    rhi::GraphicsPipelineDesc desc;   ///< Its handles are not used.
    ObjectId id = 0;
    GLuint vertex_array = 0;
    GLenum topology = 0;

    /// What the vertex array holds; worker thread only.
    struct BoundVertexBuffer {
        ObjectId id = 0;
        std::uint64_t offset = 0;
    };
    std::vector<BoundVertexBuffer> bound_vertex_buffers;
    ObjectId bound_index_buffer = 0;

  private:
    void make_vertex_array();
    DriverPointer driver_;
};

class GlComputePipeline : public rhi::BackendComputePipeline {
  public:
    static Expected<std::unique_ptr<rhi::BackendComputePipeline>> create(const DriverPointer& driver,
                                                                         const DiskCache& cache,
                                                                         const rhi::BackendComputePipelineDesc& desc);
    std::unique_ptr<Program> program;
    ObjectId id = 0;
};

}  // namespace nacre::gl
