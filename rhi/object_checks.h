// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>

#include "rhi/objects.h"
#include "rhi/validation_rules.h"

/// @file
/// Checks of descriptions, made by every device whether validation is on or off: creation is rare, and a wrong size or
/// format must never reach a driver. Each returns the first broken rule, or nothing.

namespace nacre::rhi {

using Check = std::optional<Problem>;

Check check_buffer(const BufferDesc& desc, const Capabilities& capabilities);
Check check_texture(const TextureDesc& desc, const Capabilities& capabilities);
Check check_sampler(const SamplerDesc& desc, const Capabilities& capabilities);
Check check_query_pool(const QueryPoolDesc& desc, const Capabilities& capabilities);
Check check_acceleration_structure(const AccelerationStructureDesc& desc, const Capabilities& capabilities);
/// `bindings` sorted by number.
Check check_layout(const BindGroupLayoutDesc& desc, const Capabilities& capabilities);
Check check_shader(const ShaderReflection& reflection, const std::string& name, const Capabilities& capabilities);

/// A completed view against its texture. `attempted` and `subject` go into the message.
Check check_view(const ViewReference& view, const TextureDesc& desc, const Capabilities& capabilities,
                 const char* attempted, const std::string& subject);

/// Counts of bindings in each stage against the device's limits; several layouts make a pipeline.
Check check_stage_limits(std::span<const BindGroupLayoutDesc* const> layouts, const Capabilities& capabilities,
                         const char* attempted, const std::string& subject);

std::string_view name_of(BindingType type);
std::string_view name_of(ViewDimension dimension);
std::string text_of(BufferUsage usage);
std::string text_of(TextureUsage usage);

}  // namespace nacre::rhi
