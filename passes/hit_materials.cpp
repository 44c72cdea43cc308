// SPDX-License-Identifier: Apache-2.0
#include "passes/hit_materials.h"

#include <fmt/format.h>

namespace nacre::passes {

Expected<std::unique_ptr<HitMaterials>> HitMaterials::create(rhi::Device& device, const SceneMaterials& materials,
                                                             const SceneClosures& closures, const CustomKinds& kinds) {
    if (device.capabilities().max_storage_buffers[2] < 2) {
        return fail(ErrorCode::unsupported, "shade hits", fmt::format("on '{}'", device.adapter().name),
                    "compute shaders have fewer than 2 storage buffers (max_storage_buffers)", "Use another device.");
    }
    auto result = std::unique_ptr<HitMaterials>(new HitMaterials(device, materials));
    result->text_ = closures.hit_text() + kinds.dispatch();
    for (std::uint32_t i = 0; i < closure_table_count; ++i) {
        if (i == 0 || (closures.tables() & (1u << i)) != 0) result->tables_.push_back(i);
    }
    // As many as there are, in steps, so that scenes share shaders.
    std::uint32_t capacity = 16;
    while (capacity < materials.table().size()) capacity *= 2;
    NACRE_TRY(rhi::TextureTable table,
              rhi::TextureTable::create(device, {.set = 1, .capacity = capacity, .name = "material textures"}));
    result->table_ = std::make_unique<rhi::TextureTable>(std::move(table));
    for (const SceneMaterials::BoundTexture& texture : materials.table()) {
        NACRE_TRY(const std::uint32_t number, result->table_->add(texture.texture, texture.sampler));
        if (number != texture.number) {
            return fail(ErrorCode::internal, "shade hits", "", "the table of textures numbers them in another order",
                        "This is a defect of Nacre.");
        }
    }
    NACRE_CHECK(result->table_->update());
    return result;
}

HitMaterials::~HitMaterials() {
    if (materials_group_) device_.destroy(materials_group_);
}

std::vector<rhi::ShaderDefine> HitMaterials::defines(TextureDetail detail) const {
    std::vector<rhi::ShaderDefine> defines = table_->defines();
    defines.push_back({"TEXTURE_DETAIL", std::to_string(static_cast<int>(detail))});
    defines.push_back({"MATERIAL_STRIDE", fmt::format("{}u", materials_.blob_stride())});
    return defines;
}

Expected<void> HitMaterials::bind(rhi::CommandList& list, rhi::ComputePipeline pipeline) {
    if (pipeline != pipeline_) {
        if (materials_group_) device_.destroy(materials_group_);
        NACRE_TRY(const rhi::BindGroupLayout textures, device_.bind_group_layout(pipeline, 1));
        NACRE_TRY(textures_group_, table_->bind_group(textures));
        NACRE_TRY(const rhi::BindGroupLayout layout, device_.bind_group_layout(pipeline, 2));
        std::vector<rhi::BindGroupEntry> entries = {{.binding = 0, .buffer = materials_.block()}};
        for (const std::uint32_t table : tables_) {
            entries.push_back(
                {.binding = 1 + table, .texture = materials_.table(table), .sampler = materials_.table_sampler()});
        }
        NACRE_TRY(materials_group_,
                  device_.create_bind_group({.layout = layout, .entries = entries, .name = "materials"}));
        pipeline_ = pipeline;
    }
    list.set_bind_group(1, textures_group_);
    list.set_bind_group(2, materials_group_);
    return {};
}

}  // namespace nacre::passes
