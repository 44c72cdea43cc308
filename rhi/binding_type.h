// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "rhi/resources.h"

/// @file
/// Kinds of bindings by what they have in common.

namespace nacre::rhi {

/// With `readonly` or without.
constexpr bool is_storage_buffer(BindingType type) {
    return type == BindingType::storage_buffer || type == BindingType::readonly_storage_buffer;
}
/// With `readonly`, `writeonly` or neither.
constexpr bool is_storage_image(BindingType type) {
    return type == BindingType::storage_image || type == BindingType::readonly_storage_image ||
           type == BindingType::writeonly_storage_image;
}
/// With `readonly`, `writeonly` or neither.
constexpr bool is_storage_texel_buffer(BindingType type) {
    return type == BindingType::storage_texel_buffer || type == BindingType::readonly_storage_texel_buffer ||
           type == BindingType::writeonly_storage_texel_buffer;
}
constexpr bool is_texel_buffer(BindingType type) {
    return type == BindingType::uniform_texel_buffer || is_storage_texel_buffer(type);
}
constexpr bool is_sampled(BindingType type) {
    return type == BindingType::sampled_texture || type == BindingType::combined_texture_sampler;
}
constexpr bool has_buffer(BindingType type) {
    return type == BindingType::uniform_buffer || is_storage_buffer(type) || is_texel_buffer(type);
}
constexpr bool has_texture(BindingType type) { return is_sampled(type) || is_storage_image(type); }
constexpr bool has_sampler(BindingType type) {
    return type == BindingType::sampler || type == BindingType::combined_texture_sampler;
}

/// Whether the types differ in what shaders may do, at most.
constexpr bool is_same_resource(BindingType a, BindingType b) {
    return a == b || (is_storage_buffer(a) && is_storage_buffer(b)) || (is_storage_image(a) && is_storage_image(b)) ||
           (is_storage_texel_buffer(a) && is_storage_texel_buffer(b));
}
/// The type that allows what either does; of types for which `is_same_resource` holds.
constexpr BindingType union_of(BindingType a, BindingType b) {
    if (a == b) return a;
    if (is_storage_buffer(a)) return BindingType::storage_buffer;
    return is_storage_image(a) ? BindingType::storage_image : BindingType::storage_texel_buffer;
}

}  // namespace nacre::rhi
