// SPDX-License-Identifier: Apache-2.0
#include "materials/material_blob.h"

#include <bit>

namespace nacre::materials {
namespace {

// Bits of the first word above the type, and of the last one; passes/shared/material_blob.glsl has the same.
constexpr std::uint32_t alpha_mode_shift = 16, double_sided_bit = 1u << 18, unlit_bit = 1u << 19, emits_bit = 1u << 20;
constexpr std::uint32_t textures_mask = (1u << blob_textures) - 1;
constexpr std::uint32_t second_uv_shift = 7, transformed_bit = 1u << 14, number_shift = 16;

void set_half(glm::uvec4& row, std::uint32_t index, std::uint32_t value) {
    const std::uint32_t shift = (index & 1u) * 16u;
    std::uint32_t& word = row[static_cast<glm::length_t>(index >> 1u)];
    word = (word & ~(0xffffu << shift)) | (value & 0xffffu) << shift;
}

}  // namespace

void MaterialBlob::set_header(const MaterialHeader& header) {
    std::uint32_t first = header.type | static_cast<std::uint32_t>(header.alpha_mode) << alpha_mode_shift;
    if (header.double_sided) first |= double_sided_bit;
    if (header.unlit) first |= unlit_bit;
    if (header.emits) first |= emits_bit;
    std::uint32_t last = (header.textures & textures_mask) | (header.second_uv & textures_mask) << second_uv_shift |
                         static_cast<std::uint32_t>(header.number) << number_shift;
    if (header.transformed) last |= transformed_bit;
    rows[0] = {first, std::bit_cast<std::uint32_t>(header.alpha_cutoff), header.sideband, last};
}

MaterialHeader MaterialBlob::header() const {
    const std::uint32_t first = rows[0].x, last = rows[0].w;
    return {.type = static_cast<std::uint16_t>(first & 0xffffu),
            .number = static_cast<std::uint16_t>(last >> number_shift),
            .alpha_mode = static_cast<AlphaMode>((first >> alpha_mode_shift) & 3u),
            .double_sided = (first & double_sided_bit) != 0,
            .unlit = (first & unlit_bit) != 0,
            .emits = (first & emits_bit) != 0,
            .alpha_cutoff = std::bit_cast<float>(rows[0].y),
            .sideband = rows[0].z,
            .textures = static_cast<std::uint8_t>(last & textures_mask),
            .second_uv = static_cast<std::uint8_t>((last >> second_uv_shift) & textures_mask),
            .transformed = (last & transformed_bit) != 0};
}

void MaterialBlob::set_texture(std::uint32_t index, std::uint32_t texture) {
    set_half(rows[blob_texture_row], index, texture);
}

std::uint32_t MaterialBlob::texture(std::uint32_t index) const {
    const std::uint32_t word = rows[blob_texture_row][static_cast<glm::length_t>(index >> 1u)];
    return (word >> ((index & 1u) * 16u)) & 0xffffu;
}

glm::uvec4 texture_row(std::span<const std::uint32_t> textures) {
    glm::uvec4 row(0);
    for (std::uint32_t i = 0; i < textures.size(); ++i) set_half(row, i, textures[i]);
    return row;
}

void MaterialBlob::set_numbers(std::uint32_t row, const glm::vec4& numbers) {
    for (glm::length_t i = 0; i < 4; ++i) rows[row][i] = std::bit_cast<std::uint32_t>(numbers[i]);
}

glm::vec4 MaterialBlob::numbers(std::uint32_t row) const {
    glm::vec4 result;
    for (glm::length_t i = 0; i < 4; ++i) result[i] = std::bit_cast<float>(rows[row][i]);
    return result;
}

MaterialBlob plain_slab_blob(const SingleSlab& slab) {
    MaterialBlob blob;
    blob.set_header({.type = static_cast<std::uint16_t>(BlobType::plain_slab),
                     .alpha_mode = slab.alpha_mode,
                     .double_sided = slab.double_sided,
                     .unlit = slab.unlit,
                     .emits = slab.emission != glm::vec3(0.0f),
                     .alpha_cutoff = slab.alpha_cutoff});
    blob.set_numbers(blob_payload_row, glm::vec4(slab.base_color, slab.alpha));
    blob.set_numbers(blob_payload_row + 1, glm::vec4(slab.emission, slab.metallic));
    blob.set_numbers(blob_payload_row + 2, glm::vec4(slab.f0, slab.f90));
    blob.set_numbers(blob_payload_row + 3, {slab.roughness, slab.occlusion_strength, 0.0f, 0.0f});
    blob.set_numbers(blob_normal_scale_row, {slab.normal_scale, 0.0f, 0.0f, 0.0f});
    return blob;
}

SingleSlab plain_slab_of(const MaterialBlob& blob) {
    const MaterialHeader header = blob.header();
    const glm::vec4 base = blob.numbers(blob_payload_row), emission = blob.numbers(blob_payload_row + 1);
    const glm::vec4 f0 = blob.numbers(blob_payload_row + 2), scales = blob.numbers(blob_payload_row + 3);
    SingleSlab slab;
    slab.base_color = glm::vec3(base);
    slab.alpha = base.a;
    slab.metallic = emission.w;
    slab.roughness = scales.x;
    slab.f0 = glm::vec3(f0);
    slab.f90 = f0.w;
    slab.emission = glm::vec3(emission);
    slab.occlusion_strength = scales.y;
    slab.normal_scale = blob.numbers(blob_normal_scale_row).x;
    slab.alpha_mode = header.alpha_mode;
    slab.alpha_cutoff = header.alpha_cutoff;
    slab.unlit = header.unlit;
    slab.double_sided = header.double_sided;
    return slab;
}

}  // namespace nacre::materials
