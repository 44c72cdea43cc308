// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "rhi/device.h"
#include "rhi/shader_compiler.h"

/// @file
/// Texture access by index from any shader ("bindless"), behind one interface on every device.
///
///     TextureTable table = *TextureTable::create(device, {.set = 1});
///     std::uint32_t albedo = *table.add(texture, sampler);   // goes into a buffer or push constants
///     NACRE_CHECK(table.update());
///     // GLSL, compiled with table.defines():
///     //   #include "rhi/shaders/texture_table.glsl"
///     //   vec4 color = sample_table(albedo, uv);
///     list.set_bind_group(1, *table.bind_group(*device.bind_group_layout(pipeline, 1)));
///
/// With descriptor indexing the table is one unbounded array. Without, textures are copied into pages: 2D texture
/// arrays that the shader chooses by constant indices, so it works on GLES 3.1 and with any Vulkan driver. Textures of
/// one size, format, number of mips and sampler share a page, and are sampled exactly as if they were
/// bound alone. Where a table has more kinds than pages, kinds are merged (`plan_pages` in rhi/texture_pages.h tells
/// how): smaller textures are enlarged to the size of the largest, mip by mip, so that they keep their look when
/// minified and lose nothing but some sharpness of nearest filtering when magnified.
///
/// Not thread-safe; the device's other users need no care.

namespace nacre::rhi {

struct TextureTableDesc {
    std::uint32_t set = 1;            ///< Bind-group index that the table's bindings take.
    std::uint32_t capacity = 1024;    ///< Textures; 1 to 4,096.
    std::uint32_t max_pages = 8;      ///< Texture units taken where descriptor indexing is missing, 1 to 12; less where
                                      ///< the device has fewer. A table takes all of them, used or not.
    bool force_pages = false;         ///< Use pages although descriptor indexing is there.
    std::string name = "texture table";
};

class TextureTable {
  public:
    static Expected<TextureTable> create(Device& device, const TextureTableDesc& desc);
    TextureTable(TextureTable&&) noexcept;
    TextureTable& operator=(TextureTable&&) noexcept;
    ~TextureTable();

    /// Adds a 2D texture of one layer and one sample, made with `sampled` and `copy_source`, and returns the index that
    /// shaders use; it stays the same. Texture and sampler remain the caller's and must live until they are removed
    /// and `update` was called. With pages, what is drawn into the texture after `update` is not seen.
    /// Errors: invalid_argument; out_of_memory where the capacity is used up.
    Expected<std::uint32_t> add(Texture texture, Sampler sampler);
    /// Frees an index; reads through it give 0 after the next `update`. An index that is not in use is ignored.
    void remove(std::uint32_t index);

    /// Makes what was added and removed visible to shaders; groups from `bind_group` before this are gone. Does
    /// nothing where nothing changed. Error: unsupported where the textures do not fit into the pages.
    Expected<void> update();
    /// The group to bind at `TextureTableDesc::set` for pipelines with this layout, as `Device::bind_group_layout`
    /// gives it. Valid until the next `update` that changes something.
    Expected<BindGroup> bind_group(BindGroupLayout layout);
    /// Definitions that the GLSL include needs for this table's kind and size; they never change.
    [[nodiscard]] std::vector<ShaderDefine> defines() const;
    [[nodiscard]] bool uses_pages() const;
    /// Pages in use after the last `update`; 0 with descriptor indexing.
    [[nodiscard]] std::uint32_t page_count() const;

  private:
    struct State;
    explicit TextureTable(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
};

}  // namespace nacre::rhi
