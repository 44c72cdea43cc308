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
///     // GLSL, compiled with table.defines():
///     //   #define NACRE_TEXTURE_TABLE_SET 1
///     //   #include "rhi/shaders/texture_table.glsl"
///     //   vec4 color = sample_table(albedo, uv);
///
/// With descriptor indexing the table is one unbounded array. Without, textures are copied into pages: 2D texture
/// arrays of one size and format, chosen in the shader by constant indices, so it works on GLES 3.1.

namespace nacre::rhi {

struct TextureTableDesc {
    std::uint32_t set = 1;            ///< Bind-group index that the table's bindings take.
    std::uint32_t capacity = 1024;    ///< Textures.
    std::uint32_t max_pages = 8;      ///< Pages where descriptor indexing is missing; also bounded by the device.
    bool force_pages = false;         ///< Use pages although descriptor indexing is there.
    std::string name = "texture table";
};

class TextureTable {
  public:
    static Expected<TextureTable> create(Device& device, const TextureTableDesc& desc);
    TextureTable(TextureTable&&) noexcept;
    TextureTable& operator=(TextureTable&&) noexcept;
    ~TextureTable();

    /// Adds a 2D texture and returns the index that shaders use. With pages the texture's content is copied at the next
    /// `update`; `can_change` textures are not possible there. Errors: out_of_memory (capacity), unsupported (no page left).
    Expected<std::uint32_t> add(Texture texture, Sampler sampler);
    void remove(std::uint32_t index);

    /// Brings bind group and pages up to date; call after additions and before the group is used.
    Expected<void> update();
    [[nodiscard]] BindGroup bind_group() const;
    [[nodiscard]] BindGroupLayout layout() const;
    /// Defines that the GLSL include needs for this table's kind and size.
    [[nodiscard]] std::vector<ShaderDefine> defines() const;
    [[nodiscard]] bool uses_pages() const;

  private:
    struct State;
    explicit TextureTable(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
};

}  // namespace nacre::rhi
