// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "rhi/device.h"

/// @file
/// The frame graph: passes state what they read and write, the graph leaves out what nobody needs, lets textures whose
/// lives do not overlap share memory, and records what is left in the order in which it was declared.
///
///     FrameGraph graph;
///     TextureId color = graph.add_texture({.format = Format::rgba8_unorm, .width = 64, .height = 64, .name =
///     "color"}); graph.add_pass("fill").uses(color, ResourceUse::storage_write).records([&](PassContext& pass) { ...
///     }); graph.keep(color); NACRE_CHECK(graph.compile()); NACRE_CHECK(graph.realize(device)); graph.record(list); //
///     every frame
///
/// A graph is declared once and recorded for many frames: recording makes nothing. It is not thread-safe. Barriers
/// are the RHI's work; the statements made here let its verify mode check them.

namespace nacre::passes {

/// Names a texture of a graph.
struct TextureId {
    std::uint32_t index = ~0u;
    explicit operator bool() const { return index != ~0u; }
    friend bool operator==(TextureId, TextureId) = default;
};
/// Names a buffer of a graph.
struct BufferId {
    std::uint32_t index = ~0u;
    explicit operator bool() const { return index != ~0u; }
    friend bool operator==(BufferId, BufferId) = default;
};

class FrameGraph;

/// What a pass gets while it is recorded.
struct PassContext {
    rhi::CommandList& list;
    const FrameGraph& graph;
    [[nodiscard]] rhi::Texture texture(TextureId id) const;
    [[nodiscard]] rhi::Buffer buffer(BufferId id) const;
};

/// States what a pass does; returned by `FrameGraph::add_pass` and valid until the next pass is added.
class PassDeclaration {
  public:
    /// Reads or writes a resource; several uses of one resource add up. A writing use of a texture that a pass covers
    /// only in part keeps what was there before.
    PassDeclaration& uses(TextureId texture, rhi::ResourceUse use);
    PassDeclaration& uses(BufferId buffer, rhi::ResourceUse use);
    /// The uses added by the last `count` calls are made in a frame only if the condition holds then.
    PassDeclaration& only_if(std::size_t count, std::function<bool()> condition);
    /// The pass is never left out.
    PassDeclaration& always();
    PassDeclaration& records(std::function<void(PassContext&)> function);

  private:
    friend class FrameGraph;
    PassDeclaration(FrameGraph& graph, std::uint32_t pass) : graph_(&graph), pass_(pass) {}
    FrameGraph* graph_;
    std::uint32_t pass_;
};

class FrameGraph {
  public:
    /// One use of one resource by a pass.
    struct Access {
        bool is_texture = true;
        std::uint32_t resource = 0;
        rhi::ResourceUse use = rhi::ResourceUse::none;
        std::function<bool()> condition{};  ///< Empty: in every frame.
    };
    struct Pass {
        std::string name;
        std::vector<Access> accesses;
        std::function<void(PassContext&)> function;
        bool always = false;
        bool is_live = false;  ///< After `compile`: it is recorded.
    };
    struct TextureNode {
        rhi::TextureDesc desc;         ///< `usage` follows from the passes unless it is imported.
        rhi::Texture handle{};
        bool imported = false, kept = false, unshared = false, is_detail = false;
        std::uint32_t first_pass = ~0u, last_pass = 0;  ///< Of the live passes that use it; ~0: none.
        std::uint32_t shares_with = ~0u;  ///< Index of the first texture in the same memory; ~0: its own.
        std::uint64_t bytes = 0;
        [[nodiscard]] bool is_live() const { return first_pass != ~0u; }
        [[nodiscard]] bool is_drawn() const { return is_live() && !is_detail; }
    };
    struct BufferNode {
        rhi::BufferDesc desc;
        rhi::Buffer handle{};
        bool imported = false, kept = false, is_detail = false;
        std::uint32_t first_pass = ~0u, last_pass = 0;
        [[nodiscard]] bool is_live() const { return first_pass != ~0u; }
        [[nodiscard]] bool is_drawn() const { return is_live() && !is_detail; }
    };

    FrameGraph() = default;
    FrameGraph(const FrameGraph&) = delete;
    FrameGraph& operator=(const FrameGraph&) = delete;
    ~FrameGraph();

    /// A texture that lives within a frame. `desc.usage` may be left empty.
    TextureId add_texture(const rhi::TextureDesc& desc);
    /// A texture that exists already and outlives the graph.
    /// `is_detail`: too many of its kind to be drawn.
    TextureId import_texture(rhi::Texture texture, const rhi::TextureDesc& desc, bool is_detail = false);
    BufferId add_buffer(const rhi::BufferDesc& desc);
    BufferId import_buffer(rhi::Buffer buffer, const rhi::BufferDesc& desc, bool is_detail = false);
    PassDeclaration add_pass(std::string name);

    /// The content is wanted after the frame: passes that lead to it are needed, and nothing overwrites it.
    void keep(TextureId texture);
    void keep(BufferId buffer);
    /// If passes write it anyway, nothing else takes over its memory, so that it can be read after the frame.
    void do_not_share(TextureId texture);

    /// Finds the passes and resources that are needed and which share memory. Touches no device. Error:
    /// invalid_argument where a pass reads what no pass has written, naming both.
    Expected<void> compile();
    /// Makes the textures and buffers. After `compile`.
    Expected<void> realize(rhi::Device& device);
    /// Records all live passes. With a pool, writes the timestamps 2 i and 2 i + 1 around the i-th live pass.
    void record(rhi::CommandList& list, rhi::QueryPool timestamps = {}) const;

    [[nodiscard]] rhi::Texture texture(TextureId id) const { return textures_[id.index].handle; }
    [[nodiscard]] rhi::Buffer buffer(BufferId id) const { return buffers_[id.index].handle; }
    [[nodiscard]] const rhi::TextureDesc& desc(TextureId id) const { return textures_[id.index].desc; }
    [[nodiscard]] bool is_live(TextureId id) const { return textures_[id.index].is_live(); }

    [[nodiscard]] const std::vector<Pass>& passes() const { return passes_; }
    [[nodiscard]] const std::vector<TextureNode>& textures() const { return textures_; }
    [[nodiscard]] const std::vector<BufferNode>& buffers() const { return buffers_; }
    /// Names of live passes that write a texture, comma separated.
    [[nodiscard]] std::string writers_of(TextureId id) const;
    /// Bytes of transient resources, as allocated and as they would be without sharing.
    [[nodiscard]] std::uint64_t transient_bytes() const;
    [[nodiscard]] std::uint64_t transient_bytes_unshared() const;

    /// The graph for Graphviz.
    [[nodiscard]] std::string to_dot() const;
    /// The graph as a picture: a row for each pass, a column for each piece of memory, a bar for each life.
    [[nodiscard]] std::string to_svg() const;

  private:
    friend class PassDeclaration;
    void find_live_passes();
    void share_memory();
    [[nodiscard]] bool is_drawn(const Access& access) const;

    std::vector<Pass> passes_;
    std::vector<TextureNode> textures_;
    std::vector<BufferNode> buffers_;
    rhi::Device* device_ = nullptr;
};

/// Bytes of all mips and layers of a texture.
std::uint64_t texture_bytes(const rhi::TextureDesc& desc);

}  // namespace nacre::passes
