// SPDX-License-Identifier: Apache-2.0
#include "passes/scene_materials.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fmt/format.h>

#include "materials/specular_table.h"
#include "materials/tables/anisotropy_table.h"
#include "materials/tables/interface_table.h"
#include "materials/tables/medium_table.h"
#include "passes/frame_graph.h"

namespace nacre::passes {
namespace {

/// As MaterialBlock in passes/shared/material.glsl.
struct MaterialBlock {
    glm::vec4 base_color, emission, f0, scales;
    std::array<glm::vec4, 2 * texture_slot_count> uv_rows;
};

/// translate * rotate * scale of KHR_texture_transform, as two rows.
void write_rows(const materials::TextureTransform& transform, glm::vec4* rows) {
    const float c = std::cos(transform.rotation), s = std::sin(transform.rotation);
    rows[0] = {c * transform.scale.x, s * transform.scale.y, transform.offset.x, 0.0f};
    rows[1] = {-s * transform.scale.x, c * transform.scale.y, transform.offset.y, 0.0f};
}

rhi::AddressMode address_mode(scene::Wrap wrap) {
    switch (wrap) {
        case scene::Wrap::repeat: return rhi::AddressMode::repeat;
        case scene::Wrap::mirrored_repeat: return rhi::AddressMode::mirrored_repeat;
        case scene::Wrap::clamp_to_edge: break;
    }
    return rhi::AddressMode::clamp_to_edge;
}

rhi::Filter filter(scene::Filter filter) {
    return filter == scene::Filter::nearest ? rhi::Filter::nearest : rhi::Filter::linear;
}

}  // namespace

Expected<rhi::Texture> SceneMaterials::upload_image(const scene::Scene& scene, int index, bool with_mips) {
    const auto key = std::pair(index, with_mips);
    if (const auto found = textures_.find(key); found != textures_.end()) return found->second;
    const scene::Image& image = scene.images[static_cast<std::size_t>(index)];
    const std::uint32_t limit = device_.capabilities().max_texture_2d;
    if (image.width > limit || image.height > limit) {
        return fail(ErrorCode::unsupported, "upload texture", fmt::format("'{}'", image.name),
                    fmt::format("it is {} x {} texels, the device takes at most {}", image.width, image.height, limit),
                    "Use a smaller picture.");
    }
    rhi::TextureDesc desc{
        .format = image.color_space == scene::ColorSpace::srgb ? rhi::Format::rgba8_srgb : rhi::Format::rgba8_unorm,
        .width = image.width,
        .height = image.height,
        .mips = with_mips ? rhi::full_mip_count(image.width, image.height) : 1,
        .usage = rhi::TextureUsage::sampled | rhi::TextureUsage::copy_destination,
        .name = image.name.empty() ? fmt::format("image {}", index) : image.name};
    // generate_mips reads one mip and writes the next.
    if (with_mips) desc.usage |= rhi::TextureUsage::copy_source | rhi::TextureUsage::color_target;
    NACRE_TRY(const rhi::Texture texture, device_.create_texture(desc));
    all_textures_.push_back(texture);
    textures_.emplace(key, texture);
    NACRE_CHECK(device_.write_texture(texture, std::as_bytes(std::span(*image.pixels))));
    if (desc.mips > 1) without_mips_yet_.push_back(texture);
    texture_bytes_ += passes::texture_bytes(desc);
    return texture;
}

Expected<rhi::Sampler> SceneMaterials::make_sampler(const scene::Sampler& sampler, float anisotropy) {
    rhi::SamplerDesc desc;
    desc.magnify = filter(sampler.magnification);
    desc.minify = filter(sampler.minification);
    desc.mip = sampler.mip == scene::MipFilter::linear ? rhi::Filter::linear : rhi::Filter::nearest;
    if (sampler.mip == scene::MipFilter::none) desc.max_lod = 0.0f;
    desc.address_u = address_mode(sampler.wrap_u);
    desc.address_v = address_mode(sampler.wrap_v);
    const bool all_linear = sampler.magnification == scene::Filter::linear && sampler.minification == scene::Filter::linear &&
                            sampler.mip == scene::MipFilter::linear;
    if (all_linear) desc.max_anisotropy = anisotropy;
    desc.name = "material";
    return device_.create_sampler(desc);
}

Expected<rhi::Sampler> SceneMaterials::sampler_of(const scene::Scene& scene, int index, float anisotropy) {
    if (!samplers_.contains(index)) {
        const scene::Sampler sampler = index >= 0 ? scene.samplers[static_cast<std::size_t>(index)] : scene::Sampler{};
        NACRE_TRY(samplers_[index], make_sampler(sampler, anisotropy));
    }
    return samplers_[index];
}

Expected<void> SceneMaterials::upload_tables(const scene::Scene& scene, std::uint32_t tables) {
    const std::vector<std::uint16_t> tints = materials::specular_table_words(
        scene.specular_tables.empty() ? materials::default_specular_tables() : scene.specular_tables);
    const std::span<const std::uint16_t> contents[closure_table_count] = {
        materials::interface_table(), materials::medium_table(), materials::anisotropy_table(), tints};
    constexpr const char* names[closure_table_count] = {"interface table", "medium table", "anisotropy table",
                                                           "specular tables"};
    NACRE_TRY(table_sampler_, device_.create_sampler({.magnify = rhi::Filter::nearest,
                                                      .minify = rhi::Filter::nearest,
                                                      .mip = rhi::Filter::nearest,
                                                      .address_u = rhi::AddressMode::clamp_to_edge,
                                                      .address_v = rhi::AddressMode::clamp_to_edge,
                                                      .address_w = rhi::AddressMode::clamp_to_edge,
                                                      .name = "table"}));
    for (std::uint32_t i = 0; i < closure_table_count; ++i) {
        if ((tables & (1u << i)) == 0) continue;
        // As materials/closures/table_textures.glsl reads them: an entry of four 16-bit words in a texel, or two words
        // in a texel and 128 texels in a row.
        const bool has_entries = i == 0;
        const std::uint32_t width = has_entries ? materials::interface_table_columns : 128;
        const std::size_t texel_words = has_entries ? 4 : 2;
        const std::size_t texels = contents[i].size() / texel_words, rows = (texels + width - 1) / width;
        std::vector<std::uint16_t> words(width * rows * texel_words);
        std::memcpy(words.data(), contents[i].data(), contents[i].size_bytes());
        const rhi::TextureDesc desc{.format = has_entries ? rhi::Format::rg32_uint : rhi::Format::r32_uint,
                                    .width = width,
                                    .height = static_cast<std::uint32_t>(rows),
                                    .usage = rhi::TextureUsage::sampled | rhi::TextureUsage::copy_destination,
                                    .name = names[i]};
        NACRE_TRY(tables_[i], device_.create_texture(desc));
        table_places_[i] = static_cast<std::uint32_t>(all_textures_.size());
        all_textures_.push_back(tables_[i]);
        NACRE_CHECK(device_.write_texture(tables_[i], std::as_bytes(std::span(words))));
    }
    return {};
}

Expected<void> SceneMaterials::add_closures(const scene::Scene& scene, std::uint32_t material,
                                            const ClosureMaterial& closures, std::uint64_t block_offset,
                                            float anisotropy) {
    Closures& result = closures_[material];
    std::vector<rhi::BindingLayout> bindings = {
        {.binding = 0, .type = rhi::BindingType::uniform_buffer, .stages = rhi::ShaderStage::fragment}};
    std::vector<rhi::BindGroupEntry> entries = {{.binding = 0,
                                                 .buffer = block_,
                                                 .offset = block_offset,
                                                 .size = closures.numbers.size() * sizeof(glm::vec4)}};
    const auto add = [&](std::uint32_t binding, rhi::Texture texture, rhi::Sampler sampler) {
        bindings.push_back({.binding = binding,
                            .type = rhi::BindingType::combined_texture_sampler,
                            .stages = rhi::ShaderStage::fragment});
        entries.push_back({.binding = binding, .texture = texture, .sampler = sampler});
        const auto place = std::ranges::find(all_textures_, texture) - all_textures_.begin();
        result.textures.push_back(static_cast<std::uint32_t>(place));
    };
    for (std::uint32_t i = 0; i < closure_table_count; ++i) {
        if (reads_table(closures.features, i)) add(1 + i, tables_[i], table_sampler_);
    }
    for (std::uint32_t i = 0; i < closures.textures.size(); ++i) {
        const materials::TextureReference& reference = closures.textures[i];
        const bool has_mips = reference.sampler < 0 || scene.samplers[static_cast<std::size_t>(reference.sampler)].mip !=
                                                           scene::MipFilter::none;
        NACRE_TRY(const rhi::Texture texture, upload_image(scene, reference.image, has_mips));
        NACRE_TRY(const rhi::Sampler sampler, sampler_of(scene, reference.sampler, anisotropy));
        add(first_closure_texture + i, texture, sampler);
    }
    NACRE_TRY(result.layout, device_.create_bind_group_layout({.bindings = bindings, .name = "closures"}));
    NACRE_TRY(result.group, device_.create_bind_group({.layout = result.layout,
                                                       .entries = entries,
                                                       .name = fmt::format("closures of material {}", material)}));
    return {};
}

Expected<std::unique_ptr<SceneMaterials>> SceneMaterials::create(rhi::Device& device, const scene::Scene& scene,
                                                                 const std::vector<materials::SingleSlab>& slabs,
                                                                 const SceneClosures& closures,
                                                                 const std::vector<bool>& used,
                                                                 std::uint32_t allowed_textures, float anisotropy) {
    auto result = std::unique_ptr<SceneMaterials>(new SceneMaterials(device));
    result->groups_.resize(slabs.size());
    result->layouts_.resize(slabs.size());
    result->texture_masks_.resize(slabs.size());
    result->textures_of_.resize(slabs.size());
    result->closures_.resize(slabs.size());
    // Plain slabs are lit with the first table.
    NACRE_CHECK(result->upload_tables(scene, closures.tables() | 1u));
    if (slabs.empty()) return result;

    const std::uint64_t alignment = std::max(device.capabilities().uniform_offset_alignment, 16u);
    const std::uint64_t stride = (sizeof(MaterialBlock) + alignment - 1) / alignment * alignment;
    std::vector<std::byte> blocks(stride * slabs.size());
    for (std::size_t i = 0; i < slabs.size(); ++i) {
        const materials::SingleSlab& slab = slabs[i];
        MaterialBlock block{};
        block.base_color = glm::vec4(slab.base_color, slab.alpha);
        block.emission = glm::vec4(slab.emission, slab.metallic);
        block.f0 = glm::vec4(slab.f0, slab.f90);
        block.scales = {slab.roughness, slab.occlusion_strength, slab.normal_scale, slab.alpha_cutoff};
        for (std::uint32_t slot = 0; slot < texture_slot_count; ++slot) {
            write_rows(texture_of(slab, static_cast<TextureSlot>(slot)).transform, &block.uv_rows[2 * slot]);
        }
        std::memcpy(blocks.data() + stride * i, &block, sizeof(block));
    }
    std::vector<std::uint64_t> closure_offsets(slabs.size());
    for (std::uint32_t i = 0; i < slabs.size(); ++i) {
        const ClosureMaterial* material = closures.find(i);
        if (material == nullptr) continue;
        closure_offsets[i] = blocks.size();
        const std::uint64_t size = material->numbers.size() * sizeof(glm::vec4);
        blocks.resize(blocks.size() + (size + alignment - 1) / alignment * alignment);
        std::memcpy(blocks.data() + closure_offsets[i], material->numbers.data(), size);
    }
    NACRE_TRY(result->block_, device.create_buffer({.size = blocks.size(),
                                                    .usage = rhi::BufferUsage::uniform | rhi::BufferUsage::copy_destination,
                                                    .name = "materials"}));
    NACRE_CHECK(device.write_buffer(result->block_, std::span<const std::byte>(blocks)));

    for (std::uint32_t i = 0; i < slabs.size(); ++i) {
        if (!used[i]) continue;
        if (const ClosureMaterial* material = closures.find(i)) {
            NACRE_CHECK(result->add_closures(scene, i, *material, closure_offsets[i], anisotropy));
        }
        std::vector<rhi::BindingLayout> bindings = {
            {.binding = 0, .type = rhi::BindingType::uniform_buffer, .stages = rhi::ShaderStage::fragment}};
        std::vector<rhi::BindGroupEntry> entries = {
            {.binding = 0, .buffer = result->block_, .offset = stride * i, .size = sizeof(MaterialBlock)}};
        for (std::uint32_t slot = 0; slot < texture_slot_count; ++slot) {
            const materials::TextureReference& reference = texture_of(slabs[i], static_cast<TextureSlot>(slot));
            if (!reference.present() || (allowed_textures & (1u << slot)) == 0) continue;
            const scene::Sampler sampler = reference.sampler >= 0
                                               ? scene.samplers[static_cast<std::size_t>(reference.sampler)]
                                               : scene::Sampler{};
            NACRE_TRY(const rhi::Texture texture,
                      result->upload_image(scene, reference.image, sampler.mip != scene::MipFilter::none));
            bindings.push_back({.binding = slot + 1,
                                .type = rhi::BindingType::combined_texture_sampler,
                                .stages = rhi::ShaderStage::fragment});
            NACRE_TRY(const rhi::Sampler texture_sampler, result->sampler_of(scene, reference.sampler, anisotropy));
            entries.push_back({.binding = slot + 1, .texture = texture, .sampler = texture_sampler});
            result->texture_masks_[i] |= 1u << slot;
            result->textures_of_[i].push_back(
                static_cast<std::uint32_t>(std::ranges::find(result->all_textures_, texture) - result->all_textures_.begin()));
        }
        NACRE_TRY(result->layouts_[i], device.create_bind_group_layout({.bindings = bindings, .name = "material"}));
        NACRE_TRY(result->groups_[i], device.create_bind_group({.layout = result->layouts_[i],
                                                                .entries = entries,
                                                                .name = fmt::format("material {}", i)}));
    }
    if (!result->without_mips_yet_.empty()) {
        rhi::CommandList list = device.create_command_list("mips of material textures");
        for (const rhi::Texture texture : result->without_mips_yet_) list.generate_mips(texture);
        NACRE_CHECK(device.submit(std::move(list)));
    }
    return result;
}

SceneMaterials::~SceneMaterials() {
    for (const rhi::BindGroup group : groups_) {
        if (group) device_.destroy(group);
    }
    for (const Closures& closures : closures_) {
        if (closures.group) device_.destroy(closures.group);
    }
    if (table_sampler_) device_.destroy(table_sampler_);
    for (const rhi::Texture texture : all_textures_) device_.destroy(texture);
    for (const auto& [index, sampler] : samplers_) device_.destroy(sampler);
    if (block_) device_.destroy(block_);
}

}  // namespace nacre::passes
