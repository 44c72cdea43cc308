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
        // Tables of textures may copy them.
        .usage = rhi::TextureUsage::sampled | rhi::TextureUsage::copy_destination | rhi::TextureUsage::copy_source,
        .name = image.name.empty() ? fmt::format("image {}", index) : image.name};
    // generate_mips reads one mip and writes the next.
    if (with_mips) desc.usage |= rhi::TextureUsage::color_target;
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
    const bool all_linear = sampler.magnification == scene::Filter::linear &&
                            sampler.minification == scene::Filter::linear && sampler.mip == scene::MipFilter::linear;
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

Expected<SceneMaterials::BoundTexture> SceneMaterials::texture_for(const scene::Scene& scene,
                                                                   const materials::TextureReference& reference,
                                                                   float anisotropy) {
    const bool has_mips = reference.sampler < 0 || scene.samplers[static_cast<std::size_t>(reference.sampler)].mip !=
                                                       scene::MipFilter::none;
    BoundTexture result;
    NACRE_TRY(result.texture, upload_image(scene, reference.image, has_mips));
    NACRE_TRY(result.sampler, sampler_of(scene, reference.sampler, anisotropy));
    const auto same = [&](const BoundTexture& other) {
        return other.texture == result.texture && other.sampler == result.sampler;
    };
    const auto known = std::ranges::find_if(table_, same);
    result.number = static_cast<std::uint32_t>(known - table_.begin());
    if (known == table_.end()) table_.push_back(result);
    return result;
}

std::uint32_t SceneMaterials::place_of(rhi::Texture texture) const {
    return static_cast<std::uint32_t>(std::ranges::find(all_textures_, texture) - all_textures_.begin());
}

std::uint32_t SceneMaterials::add_rows(std::span<const glm::uvec4> rows) {
    // Draws bind some of these rows as a block of their own.
    while (rows_.size() % row_alignment_ != 0) rows_.emplace_back(0);
    const auto first = static_cast<std::uint32_t>(rows_.size());
    rows_.insert(rows_.end(), rows.begin(), rows.end());
    return first;
}

Expected<void> SceneMaterials::add_closures(const scene::Scene& scene, std::uint32_t material,
                                            const ClosureMaterial& closures, float anisotropy) {
    Closures& result = closures_[material];
    std::vector<std::uint32_t> numbers;
    for (const materials::TextureReference& reference : closures.textures) {
        NACRE_TRY(const BoundTexture texture, texture_for(scene, reference, anisotropy));
        result.bound.push_back(texture);
        numbers.push_back(texture.number);
    }
    result.first_row =
        add_rows({reinterpret_cast<const glm::uvec4*>(closures.numbers.data()), closures.numbers.size()});
    result.row_count = static_cast<std::uint32_t>(closures.numbers.size());
    std::vector<glm::uvec4> texture_rows;
    for (std::size_t i = 0; i < numbers.size(); i += 8) {
        texture_rows.push_back(
            materials::texture_row(std::span(numbers).subspan(i, std::min<std::size_t>(8, numbers.size() - i))));
    }
    blobs_[material].rows[materials::blob_tree_row] = {result.first_row, add_rows(texture_rows), 0, 0};
    materials::MaterialHeader header = blobs_[material].header();
    header.type =
        static_cast<std::uint16_t>(static_cast<std::uint32_t>(materials::BlobType::first_tree) + closures.topology);
    blobs_[material].set_header(header);
    return {};
}

Expected<void> SceneMaterials::bind_closures(std::uint32_t material, const ClosureMaterial& closures) {
    Closures& result = closures_[material];
    // The numbers come first: lavapipe of Mesa 22.3 dies where conditions read the second uniform buffer of a set, and
    // draws of trees read nothing of the blob but its number.
    std::vector<rhi::BindingLayout> bindings = {
        {.binding = 0, .type = rhi::BindingType::uniform_buffer, .stages = rhi::ShaderStage::fragment},
        {.binding = sideband_binding, .type = rhi::BindingType::uniform_buffer, .stages = rhi::ShaderStage::fragment}};
    std::vector<rhi::BindGroupEntry> entries = {{.binding = 0,
                                                 .buffer = block_,
                                                 .offset = result.first_row * sizeof(glm::uvec4),
                                                 .size = result.row_count * sizeof(glm::uvec4)},
                                                {.binding = sideband_binding,
                                                 .buffer = block_,
                                                 .offset = std::uint64_t{material} * blob_stride_ * sizeof(glm::uvec4),
                                                 .size = sizeof(materials::MaterialBlob)}};
    const auto add = [&](std::uint32_t binding, rhi::Texture texture, rhi::Sampler sampler) {
        bindings.push_back({.binding = binding,
                            .type = rhi::BindingType::combined_texture_sampler,
                            .stages = rhi::ShaderStage::fragment});
        entries.push_back({.binding = binding, .texture = texture, .sampler = sampler});
        result.textures.push_back(place_of(texture));
    };
    for (std::uint32_t i = 0; i < closure_table_count; ++i) {
        if (reads_table(closures.features, i)) add(1 + i, tables_[i], table_sampler_);
    }
    for (std::uint32_t i = 0; i < result.bound.size(); ++i) {
        add(first_material_texture + i, result.bound[i].texture, result.bound[i].sampler);
    }
    NACRE_TRY(result.layout, device_.create_bind_group_layout({.bindings = bindings, .name = "closures"}));
    NACRE_TRY(result.group, device_.create_bind_group({.layout = result.layout,
                                                       .entries = entries,
                                                       .name = fmt::format("closures of material {}", material)}));
    return {};
}

Expected<void> SceneMaterials::add_slab(const scene::Scene& scene, std::uint32_t material,
                                        const materials::SingleSlab& slab, const materials::CustomMaterialData* custom,
                                        std::uint32_t allowed_textures, float anisotropy) {
    materials::MaterialBlob& blob = blobs_[material];
    if (custom != nullptr) {
        for (std::uint32_t i = 0; i < custom->numbers.size(); ++i) {
            blob.set_numbers(materials::blob_payload_row + i, custom->numbers[i]);
        }
    }
    materials::MaterialHeader header = blob.header();
    std::vector<glm::vec4> sideband;
    if (moves_textures(slab)) {
        header.transformed = true;
        sideband.resize(2 * texture_slot_count);
        for (std::uint32_t slot = 0; slot < texture_slot_count; ++slot) {
            write_uv_rows(texture_of(slab, static_cast<TextureSlot>(slot)).transform, &sideband[2 * slot]);
        }
    }
    Slab& result = slabs_[material];
    for (std::uint32_t slot = 0; slot < texture_slot_count; ++slot) {
        const materials::TextureReference& reference = texture_of(slab, static_cast<TextureSlot>(slot));
        if (!reference.present() || (allowed_textures & (1u << slot)) == 0) continue;
        NACRE_TRY(const BoundTexture texture, texture_for(scene, reference, anisotropy));
        result.bound.emplace_back(slot, texture);
        blob.set_texture(slot, texture.number);
        header.textures = static_cast<std::uint8_t>(header.textures | 1u << slot);
        if (reference.uv_set == 1) header.second_uv = static_cast<std::uint8_t>(header.second_uv | 1u << slot);
    }
    if (custom != nullptr) {
        result.custom_row = static_cast<std::uint32_t>(sideband.size());
        sideband.insert(sideband.end(), custom->sideband.begin(), custom->sideband.end());
    }
    if (!sideband.empty()) {
        header.sideband = add_rows({reinterpret_cast<const glm::uvec4*>(sideband.data()), sideband.size()});
        result.row_count = static_cast<std::uint32_t>(sideband.size());
        result.custom_row += header.sideband;
    }
    blob.set_header(header);
    return {};
}

Expected<void> SceneMaterials::bind_slab(std::uint32_t material) {
    Slab& slab = slabs_[material];
    std::vector<rhi::BindingLayout> bindings = {
        {.binding = 0, .type = rhi::BindingType::uniform_buffer, .stages = rhi::ShaderStage::fragment}};
    std::vector<rhi::BindGroupEntry> entries = {{.binding = 0,
                                                 .buffer = block_,
                                                 .offset = std::uint64_t{material} * blob_stride_ * sizeof(glm::uvec4),
                                                 .size = sizeof(materials::MaterialBlob)}};
    if (slab.row_count > 0) {
        bindings.push_back({.binding = sideband_binding,
                            .type = rhi::BindingType::uniform_buffer,
                            .stages = rhi::ShaderStage::fragment});
        entries.push_back({.binding = sideband_binding,
                           .buffer = block_,
                           .offset = blobs_[material].header().sideband * sizeof(glm::uvec4),
                           .size = slab.row_count * sizeof(glm::uvec4)});
        texture_masks_[material] |= 1u << texture_slot_count;
    }
    for (const auto& [slot, texture] : slab.bound) {
        bindings.push_back({.binding = first_material_texture + slot,
                            .type = rhi::BindingType::combined_texture_sampler,
                            .stages = rhi::ShaderStage::fragment});
        entries.push_back(
            {.binding = first_material_texture + slot, .texture = texture.texture, .sampler = texture.sampler});
        texture_masks_[material] |= 1u << slot;
        textures_of_[material].push_back(place_of(texture.texture));
    }
    NACRE_TRY(layouts_[material], device_.create_bind_group_layout({.bindings = bindings, .name = "material"}));
    NACRE_TRY(groups_[material], device_.create_bind_group({.layout = layouts_[material],
                                                            .entries = entries,
                                                            .name = fmt::format("material {}", material)}));
    return {};
}

Expected<std::unique_ptr<SceneMaterials>> SceneMaterials::create(rhi::Device& device, const scene::Scene& scene,
                                                                 const std::vector<materials::SingleSlab>& slabs,
                                                                 const SceneClosures& closures,
                                                                 const CustomKinds& kinds,
                                                                 const std::vector<bool>& used,
                                                                 std::uint32_t allowed_textures, float anisotropy) {
    auto result = std::unique_ptr<SceneMaterials>(new SceneMaterials(device));
    result->groups_.resize(slabs.size());
    result->layouts_.resize(slabs.size());
    result->texture_masks_.resize(slabs.size());
    result->textures_of_.resize(slabs.size());
    result->closures_.resize(slabs.size());
    result->slabs_.resize(slabs.size());
    result->blobs_.resize(slabs.size());
    // Plain slabs are lit with the first table.
    NACRE_CHECK(result->upload_tables(scene, closures.tables() | 1u));
    if (slabs.empty()) return result;
    if (slabs.size() > max_materials) {
        return fail(ErrorCode::unsupported, "upload materials", fmt::format("'{}'", scene.name),
                    fmt::format("{} materials are more than {}", slabs.size(), max_materials), "Use fewer materials.");
    }

    constexpr std::uint32_t row_bytes = sizeof(glm::uvec4);
    result->row_alignment_ = std::max(device.capabilities().uniform_offset_alignment / row_bytes, 1u);
    result->blob_stride_ = std::max(materials::blob_rows, result->row_alignment_);
    result->rows_.resize(result->blob_stride_ * slabs.size());
    for (std::uint32_t i = 0; i < slabs.size(); ++i) {
        materials::MaterialBlob& blob = result->blobs_[i];
        blob = materials::plain_slab_blob(slabs[i]);
        materials::MaterialHeader header = blob.header();
        header.number = static_cast<std::uint16_t>(i);
        if (const std::uint32_t kind = kinds.kind_of(i); kind != 0) {
            header.type =
                static_cast<std::uint16_t>(static_cast<std::uint32_t>(materials::BlobType::first_custom) + kind);
            result->customs_.push_back({i, kinds.material(i)});
        }
        blob.set_header(header);
        if (used[i]) {
            NACRE_CHECK(result->add_slab(scene, i, slabs[i], kinds.data_of(i), allowed_textures, anisotropy));
            if (const ClosureMaterial* material = closures.find(i)) {
                NACRE_CHECK(result->add_closures(scene, i, *material, anisotropy));
            }
        }
        std::ranges::copy(blob.rows, result->rows_.begin() + static_cast<std::ptrdiff_t>(i * result->blob_stride_));
    }
    auto usage = rhi::BufferUsage::uniform | rhi::BufferUsage::copy_destination;
    if (device.capabilities().max_storage_buffers[2] > 0) usage |= rhi::BufferUsage::storage;
    NACRE_TRY(result->block_,
              device.create_buffer({.size = result->rows_.size() * row_bytes, .usage = usage, .name = "materials"}));
    NACRE_CHECK(device.write_buffer(result->block_, std::as_bytes(std::span(result->rows_))));
    for (std::uint32_t i = 0; i < slabs.size(); ++i) {
        if (!used[i]) continue;
        if (const ClosureMaterial* material = closures.find(i)) NACRE_CHECK(result->bind_closures(i, *material));
        NACRE_CHECK(result->bind_slab(i));
    }
    if (!result->without_mips_yet_.empty()) {
        rhi::CommandList list = device.create_command_list("mips of material textures");
        for (const rhi::Texture texture : result->without_mips_yet_) list.generate_mips(texture);
        NACRE_CHECK(device.submit(std::move(list)));
    }
    return result;
}

Expected<std::uint32_t> SceneMaterials::update() {
    std::uint32_t changed = 0;
    for (const auto& [index, custom] : customs_) {
        if (custom->update() == materials::MaterialUpdate::none) continue;
        ++changed;
        const materials::CustomMaterialData data = custom->data();
        materials::MaterialBlob& blob = blobs_[index];
        for (std::uint32_t i = 0; i < data.numbers.size(); ++i) {
            blob.set_numbers(materials::blob_payload_row + i, data.numbers[i]);
        }
        NACRE_CHECK(device_.write_buffer(block_, std::as_bytes(std::span(blob.rows)),
                                         std::uint64_t{index} * blob_stride_ * sizeof(glm::uvec4)));
        const Slab& slab = slabs_[index];
        const std::uint32_t moving = blob.header().transformed ? 2 * texture_slot_count : 0;
        if (data.sideband.size() + moving != slab.row_count) {
            return fail(
                ErrorCode::invalid_argument, "update material", fmt::format("{}", index),
                fmt::format("its sideband had {} rows and has {}", slab.row_count - moving, data.sideband.size()),
                "Keep the size of a sideband.");
        }
        if (data.sideband.empty()) continue;
        NACRE_CHECK(device_.write_buffer(block_, std::as_bytes(std::span(data.sideband)),
                                         std::uint64_t{slab.custom_row} * sizeof(glm::uvec4)));
    }
    return changed;
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
